"""What a group of an HDF5 file holds, found out with as few calls as possible.

A session of a thousand runs has ten thousand objects; h5py's own objects cost several times more than
what HDF5 itself needs to look at them, and opening is what every command does first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5o, h5t

from fingerlab.sessions.format import plain


@dataclass(frozen=True)
class DatasetFacts:
    """Shape, whether it holds numbers, and the attribute ``units`` (None where there is none)."""

    shape: tuple[int, ...]
    numeric: bool
    unit: str | None


def datasets_of(group: h5py.Group) -> dict[str, DatasetFacts]:
    """The datasets directly in a group, by name; links that lead nowhere are left out."""
    found = {}
    for name in group.id:
        try:
            item = h5o.open(group.id, name)
        except (KeyError, OSError, RuntimeError):
            continue
        if isinstance(item, h5d.DatasetID):
            kind = item.get_type().get_class()
            found[name.decode("utf-8", errors="replace")] = DatasetFacts(
                item.shape or (), kind in (h5t.FLOAT, h5t.INTEGER), _units(item)
            )
    return found


def attributes_of(item: h5py.HLObject) -> dict[str, Any]:
    """Attributes as plain values; one of a type that Python cannot hold is left out."""
    found = {}
    for name in item.attrs:
        try:
            found[name] = plain(item.attrs[name])
        except TypeError:
            continue
    return found


def _units(dataset: h5d.DatasetID) -> str | None:
    if not h5a.exists(dataset, b"units"):
        return None
    attribute = h5a.open(dataset, b"units")
    value = np.empty(attribute.shape, dtype=attribute.dtype)
    attribute.read(value)
    return str(plain(value))
