"""Where everything is, from the one folder that holds ``start.py``."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Places:
    """The folders and files of one checkout.

    Attributes:
        root: folder of ``start.py``, absolute.
    """

    root: Path

    @property
    def venv(self) -> Path:
        """The environment that the starter makes and owns."""
        return self.root / ".venv"

    @property
    def python(self) -> Path:
        """The environment's interpreter."""
        if os.name == "nt":
            return self.venv / "Scripts" / "python.exe"
        return self.venv / "bin" / "python"

    @property
    def stamp(self) -> Path:
        """Says what the environment holds; written last, when all is in place."""
        return self.venv / "fingerlab-stamp.json"

    @property
    def unfinished(self) -> Path:
        """Stands while installers write; found at a start, it tells that one of them was killed."""
        return self.venv / "fingerlab-unfinished"

    @property
    def log(self) -> Path:
        """What the installers printed."""
        return self.venv / "install.log"

    @property
    def project(self) -> Path:
        """The project's own file: a change of it may change what has to be installed."""
        return self.root / "pyproject.toml"

    def locked(self, tools: str) -> Path:
        """The locked dependencies of ``tools``: ``app``, or ``test`` (which holds ``app`` too)."""
        return self.root / "requirements" / f"{tools}.txt"

    @property
    def output(self) -> Path:
        """Folder of the practice session and its report."""
        return self.root / "fingerlab-out"


def here() -> Places:
    """The checkout that this file belongs to."""
    return Places(Path(__file__).resolve().parents[2])
