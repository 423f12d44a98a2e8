"""What a run recorded: as xarray with the units of the session format, and drawn over time."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.text import screen_unit
from fingerlab.sessions.model import Run, Session

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


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


USUAL = ("motor_torque", "mcp_angle", "pip_angle", "endpoint_force")
"""Drawn where nobody asks for others: what the model speaks of."""
WIDTH_INCHES, ROW_INCHES, MARGIN_INCHES = 7.2, 1.3, 0.5


def channel_figure(run: Run, channels: Sequence[str] = ()) -> Figure:
    """The channels over time, one above the other, in the units of the screen (degrees, newtons).

    Args:
        channels: names as in ``run.units``; for none, those of ``USUAL`` that were read.

    Raises:
        UserError: the run has no such channel.
    """
    from fingerlab.report.figure_style import MEASURED, label, new_figure  # matplotlib takes a while to load

    names = list(channels) or [name for name in USUAL if run.has(name)] or list(run.units)
    values = run.load(dict.fromkeys(("time", *names)))
    if not channels:  # a load cell that was not read holds NaN throughout
        names = [name for name in names if np.isfinite(values[name]).any()] or names
    size = (WIDTH_INCHES, MARGIN_INCHES + ROW_INCHES * len(names))
    figure, rows = new_figure(len(names), 1, size, sharex=True)
    for axes, name in zip(rows, names, strict=True):
        finite = np.abs(values[name][np.isfinite(values[name])])
        unit = screen_unit(run.units[name], float(finite.max()) if len(finite) else 0.0)
        axes.plot(values["time"], unit.factor * values[name], color=MEASURED, lw=1.0)
        axes.margins(x=0.0)
        label(axes, "", unit.label(name.replace("_", " ")))
    label(rows[-1], "time in the run (s)", rows[-1].get_ylabel())
    figure.align_ylabels()
    return figure
