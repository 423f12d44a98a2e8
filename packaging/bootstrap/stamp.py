"""The stamp: how a second start knows, from four small files, that there is nothing to install."""

from __future__ import annotations

import hashlib
import json
import sys
import sysconfig
from dataclasses import asdict, dataclass

from .places import Places

TOOLS = ("app", "test")
"""What can be asked for; each holds the ones before it."""


@dataclass(frozen=True)
class Stamp:
    """What an environment was made of.

    Attributes:
        python: version (major.minor) and platform of the interpreter.
        root: the checkout: an environment does not survive being moved.
        locks: SHA-256 over the lock files and ``pyproject.toml``.
        tools: ``app`` or ``test``.
    """

    python: str
    root: str
    locks: str
    tools: str

    def serves(self, wanted: Stamp) -> bool:
        """Whether this environment holds all that ``wanted`` asks for."""
        same = (self.python, self.root, self.locks) == (wanted.python, wanted.root, wanted.locks)
        return same and _at_least(self.tools, wanted.tools)


def _at_least(held: str, wanted: str) -> bool:
    return held in TOOLS and TOOLS.index(held) >= TOOLS.index(wanted)


def wanted_stamp(places: Places, tools: str) -> Stamp:
    """The stamp that an environment made now would bear."""
    digest = hashlib.sha256()
    for path in (places.project, *(places.locked(name) for name in TOOLS)):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    version = f"{sys.version_info[0]}.{sys.version_info[1]} {sysconfig.get_platform()}"
    return Stamp(python=version, root=str(places.root), locks=digest.hexdigest(), tools=tools)


def read_stamp(places: Places) -> Stamp | None:
    """The environment's stamp; None where there is none or it cannot be read."""
    try:
        return Stamp(**json.loads(places.stamp.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def write_stamp(places: Places, stamp: Stamp) -> None:
    """Declare the environment complete."""
    part = places.stamp.with_suffix(".part")
    part.write_text(json.dumps(asdict(stamp)), encoding="utf-8")
    part.replace(places.stamp)
