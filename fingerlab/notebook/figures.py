"""Figures by name, shown in a notebook without any set-up, and saved as files."""

from __future__ import annotations

import html
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fingerlab.core.files import OutputSet

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Figures(Mapping[str, "Figure"]):
    """Matplotlib figures by name. They belong to no pyplot session: change, combine and save them freely."""

    def __init__(self, figures: Mapping[str, Figure]) -> None:
        self._figures = dict(figures)

    def __getitem__(self, name: str) -> Figure:
        return self._figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def __len__(self) -> int:
        return len(self._figures)

    def __repr__(self) -> str:
        return f"{len(self)} figures: {', '.join(self)}"

    def _repr_html_(self) -> str:
        return "".join(
            f"<figure><figcaption>{html.escape(name)}</figcaption>{_svg(figure)}</figure>"
            for name, figure in self._figures.items()
        )

    def save(self, folder: str | Path, kind: str = "png") -> list[Path]:
        """Write every figure into a folder, all or none; returns the files.

        Args:
            kind: ``png``, ``svg`` or ``pdf``.

        Raises:
            UserError: a file is there already, or the folder cannot be written to.
        """
        folder = Path(folder)
        files = [folder / f"{name}.{kind}" for name in self]
        with OutputSet() as outputs:
            outputs.make_folder(folder)
            for path, figure in zip(files, self.values(), strict=True):
                figure.savefig(outputs.claim(path), format=kind)
        return files


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg")
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]
