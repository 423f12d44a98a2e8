"""Where a long calculation reports, and where it hears that it should stop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fingerlab.core.errors import Cancelled

Progress = Callable[[float, str], None]
"""Is told the share done (0 to 1) and what is being done."""


@dataclass(frozen=True)
class Watch:
    """Where a long calculation reports, and where it hears that it should stop."""

    progress: Progress | None = None
    cancelled: Callable[[], bool] | None = None

    def tell(self, share: float, what: str) -> None:
        """Report, and stop where asked to.

        Raises:
            Cancelled: the user asked for it.
        """
        if self.cancelled is not None and self.cancelled():
            raise Cancelled
        if self.progress is not None:
            self.progress(share, what)


SILENT = Watch()
"""Nobody looks."""
