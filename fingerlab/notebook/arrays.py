"""Runs and sessions as xarray, with the units of the session format."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Run, Session

if TYPE_CHECKING:
    import xarray


def _xarray() -> ModuleType:
    try:
        import xarray
    except ImportError:
        raise UserError(
            "xarray is not installed, and sessions as xarray need it; 'pip install xarray' brings it."
        ) from None
    return xarray


def run_dataset(run: Run, channels: Iterable[str] | None = None) -> xarray.Dataset:
    """One run: every channel a variable over the coordinate ``time``, float64, with its unit in ``units``.

    A channel as read, ``raw/force``, is called ``raw_force``: names in xarray hold no slash.

    Args:
        channels: names as in ``Run.units``; all of them for None.

    Raises:
        UserError: the run has no such channel, or the file can no longer be read.
    """
    names = list(run.units) if channels is None else list(dict.fromkeys(channels))
    values = run.load(dict.fromkeys(("time", *names)))
    time = values.pop("time")
    variables = {
        name.replace("/", "_"): ("time", samples, {"units": run.units[name]})
        for name, samples in values.items()
    }
    told = {"run": run.name, "phase": run.phase, "cable": run.cable, "sample_rate_hz": run.sample_rate_hz}
    told |= {"trajectory": json.dumps(dict(run.trajectory))} | _plain(run.attributes)
    made: xarray.Dataset = _xarray().Dataset(variables, {"time": ("time", time, {"units": "s"})}, told)
    return made


def session_tree(session: Session) -> xarray.DataTree:
    """The whole session: a tree with one dataset a run, named as in the file; every sample is read.

    Raises:
        UserError: a run can no longer be read.
    """
    told = {"title": session.title, "created": session.created, "rig": session.rig.to_json()}
    told |= _plain(session.attributes)
    library = _xarray()
    root = library.Dataset(attrs=told)
    datasets = {f"/{run.name}": run_dataset(run) for run in session.runs}
    made: xarray.DataTree = library.DataTree.from_dict({"/": root, **datasets}, name=session.path.stem)
    return made


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes that netCDF can hold as well: it has no booleans."""
    return {k: int(v) if isinstance(v, (bool, np.bool_)) else v for k, v in attributes.items()}
