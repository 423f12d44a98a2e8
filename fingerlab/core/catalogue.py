"""A folder of modules as a catalogue: one file an entry, and nothing else names it."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any


def found_in(paths: Iterable[str], package: str, order: Sequence[str]) -> dict[str, Any]:
    """The object ``EFFECT`` of every module that has one, by its id.

    Args:
        paths: folders of the package. package: its dotted name.
        order: ids that come first, in this order; the others come behind them by id.
    """
    modules = (import_module(f"{package}.{info.name}") for info in pkgutil.iter_modules(paths))
    found = {one.EFFECT.id: one.EFFECT for one in modules if hasattr(one, "EFFECT")}
    places = {name: place for place, name in enumerate(order)}
    names = sorted(found, key=lambda name: (places.get(name, len(places)), name))
    return {name: found[name] for name in names}
