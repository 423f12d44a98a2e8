"""The session files of the goldens: made by the program's simulator or the second engine, and kept."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.goldens.calling import call
from tests.goldens.items import Item

UNTOLD = ("created", "software")
"""Attributes of a session file that say when and by which version it was written."""


def files_of(item: Item, folder: Path) -> list[Path]:
    """The item's session files below ``folder``; made where they are missing.

    Raises:
        RuntimeError: one cannot be made.
    """
    if item.recording is not None and item.recording.is_file():
        return [item.recording]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{item.name}.h5"
    if not path.exists():
        part = folder / f"{item.name}.part.h5"  # what was stopped half-way is not taken for a session
        part.unlink(missing_ok=True)
        _make(item, part)
        part.replace(path)
    return [path, _proposed(item, folder, path)] if item.proposed else [path]


def _make(item: Item, path: Path) -> None:
    if item.recording is not None:
        texts = sorted(item.recording.glob("*.txt"))
        _must("import", *texts, "--phase", "contact", "--cable", "flexion", "--yes", "--out", path)
    elif item.engine is not None:
        from tests.hidden.engine.session import record  # MuJoCo is imported by those who need it

        effects, seed = item.engine
        record(path, "rich", dict.fromkeys(effects), seed)
    elif item.simulate is not None:
        _must("simulate", *item.simulate, "--out", path)


def _proposed(item: Item, folder: Path, session: Path) -> Path:
    """The run that the diagnosis proposed when the goldens were stored, taken on the same bench."""
    proposal, path = folder / f"{item.name}-proposed.json", folder / f"{item.name}-proposed.h5"
    if not proposal.exists():
        said = folder / f"{item.name}-said.part.json"
        said.unlink(missing_ok=True)
        _must("diagnose", session, "--json", said)
        found = json.loads(said.read_text(encoding="utf-8"))["next_experiment"]
        said.unlink()
        if found is None:
            raise RuntimeError(f"the diagnosis of {item.name} proposes no run; choose another session")
        proposal.write_text(json.dumps(found), encoding="utf-8")
    if not path.exists():
        words = list(item.simulate or ())
        at = words.index("--protocol")
        del words[at : at + 2]
        part = folder / f"{item.name}-proposed.part.h5"
        part.unlink(missing_ok=True)
        _must("simulate", "--trajectory", proposal.read_text(encoding="utf-8"), *words, "--out", part)
        part.replace(path)
    return path


def _must(*arguments: str | Path) -> None:
    done = call(*arguments)
    if done.code != 0:
        raise RuntimeError(f"'fingerlab {arguments[0]}' failed: {done.errors.strip()}")


def content(path: Path) -> dict[str, Any]:
    """A hash of each run's samples and attributes, and the file's own attributes; read with h5py alone."""
    with h5py.File(path, "r") as file:
        runs = {name: _hash(group) for name, group in sorted(file["runs"].items())}
        told = {k: str(v) for k, v in sorted(file.attrs.items()) if k not in UNTOLD}
    return {"attributes": told, "runs": runs}


def _hash(group: h5py.Group) -> str:
    found = hashlib.sha256()

    def add(name: str, thing: h5py.Group | h5py.Dataset) -> None:
        if isinstance(thing, h5py.Dataset):
            values = np.ascontiguousarray(thing[()])
            found.update(f"{name} {values.dtype.str} {values.shape} {thing.attrs.get('units')}".encode())
            found.update(values.tobytes())

    for key, value in sorted(group.attrs.items()):
        found.update(f"{key}={value!s}".encode())
    group.visititems(add)  # in the order of the names
    return found.hexdigest()[:20]
