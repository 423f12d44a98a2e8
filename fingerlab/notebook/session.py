"""A session, its runs and what they recorded, as a notebook shows them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import screen_unit
from fingerlab.notebook.diagnosis import DiagnosisView, diagnose
from fingerlab.notebook.model import Displayable, Displayed, ModelView, ShownTable, effect_ids, fit
from fingerlab.sessions.model import CHANNEL_UNITS, Run, Session
from fingerlab.sessions.reading import open_session

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
    attrs = {"run": run.name, "phase": run.phase, "cable": run.cable, "sample_rate_hz": run.sample_rate_hz}
    attrs |= {"trajectory": json.dumps(dict(run.trajectory))} | _plain(run.attributes)
    made: xarray.Dataset = _xarray().Dataset(variables, {"time": ("time", time, {"units": "s"})}, attrs)
    return made


def session_tree(session: Session) -> xarray.DataTree:
    """The whole session: a tree with one dataset a run, named as in the file; every sample is read.

    Raises:
        UserError: a run can no longer be read.
    """
    attrs = {"title": session.title, "created": session.created, "rig": session.rig.to_json()}
    attrs |= _plain(session.attributes)
    library = _xarray()
    root = library.Dataset(attrs=attrs)
    datasets = {f"/{run.name}": run_dataset(run) for run in session.runs}
    made: xarray.DataTree = library.DataTree.from_dict({"/": root, **datasets}, name=session.path.stem)
    return made


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes that netCDF can hold as well: it has no booleans."""
    return {k: int(v) if isinstance(v, (bool, np.bool_)) else v for k, v in attributes.items()}


USUAL = ("motor_torque", "mcp_angle", "pip_angle", "endpoint_force")
"""Drawn where nobody asks for others: what the model speaks of."""

WIDTH_INCHES, ROW_INCHES, MARGIN_INCHES = 7.2, 1.3, 0.5


class RunView(Displayed):
    """One run. ``run`` is the object behind it (``fingerlab.sessions.Run``).

    Args:
        radius: ``Rig.line_radius`` of its session, m: of a linear axis, whose motion is told in mm.
    """

    def __init__(self, run: Run, radius: float = 0.0) -> None:
        self.run, self._radius = run, radius

    @property
    def name(self) -> str:
        """Name in the file, such as ``001``."""
        return self.run.name

    @property
    def channels(self) -> dict[str, str]:
        """Unit of each channel by name."""
        return dict(self.run.units)

    def to_xarray(self, channels: Iterable[str] | None = None) -> xarray.Dataset:
        """The run as a dataset over ``time`` (s), SI units in ``units``; see :func:`run_dataset`."""
        return run_dataset(self.run, channels)

    def figure(self, *channels: str) -> Figure:
        """The channels over time, one above the other; the joints and the motor's torque where none is named.

        Raises:
            UserError: the run has no such channel.
        """
        # matplotlib takes a while to load
        from fingerlab.report.figure_style import MEASURED, label, new_figure
        from fingerlab.report.line_units import LineUnits

        line = LineUnits(self._radius)
        names = list(channels) or [name for name in USUAL if self.run.has(name)] or list(self.run.units)
        values = self.run.load(dict.fromkeys(("time", *names)))
        if not channels:  # a load cell that was not read holds NaN throughout
            names = [name for name in names if np.isfinite(values[name]).any()] or names
        size = (WIDTH_INCHES, MARGIN_INCHES + ROW_INCHES * len(names))
        figure, rows = new_figure(len(names), 1, size, sharex=True)
        for axes, name in zip(rows, names, strict=True):
            finite = np.abs(values[name][np.isfinite(values[name])])
            largest = float(finite.max()) if len(finite) else 0.0
            known = name in CHANNEL_UNITS
            unit = line.channel(name, largest) if known else screen_unit(self.run.units[name], largest)
            axes.plot(values["time"], unit.factor * values[name], color=MEASURED, lw=1.0)
            axes.margins(x=0.0)
            label(axes, "", unit.label(line.called(name)))
        label(rows[-1], "time in the run (s)", rows[-1].get_ylabel())
        figure.align_ylabels()
        return figure

    def _parts(self) -> Sequence[Displayable]:
        from fingerlab.report.diagnosis_words import PHASE_WORDS
        from fingerlab.sessions.trajectory import motion_of_run

        run = self.run
        cable = "no cable" if run.cable == "none" else f"{run.cable} cable"
        line = (
            f"run {run.name}: {PHASE_WORDS.get(run.phase, run.phase)}, {cable}, "
            f"{motion_of_run(run, self._radius)}; {run.seconds:.1f} s at {run.sample_rate_hz:g} Hz"
        )
        return (line, ShownTable(("channel", "unit"), list(run.units.items())))


class SessionView(Displayed):
    """A session; its runs by name: ``s["001"]``. ``session`` is the object behind it."""

    def __init__(self, session: Session) -> None:
        self.session = session

    @property
    def path(self) -> Path:
        """The session's file."""
        return self.session.path

    @property
    def runs(self) -> tuple[RunView, ...]:
        """Every run, in the order taken."""
        return tuple(RunView(run, self.session.rig.line_radius) for run in self.session.runs)

    def __len__(self) -> int:
        return len(self.session.runs)

    def __iter__(self) -> Iterator[RunView]:
        return iter(self.runs)

    def __getitem__(self, name: str) -> RunView:
        for run in self.session.runs:
            if run.name == name:
                return RunView(run, self.session.rig.line_radius)
        names = ", ".join(run.name for run in self.session.runs)
        raise UserError(f"{self.path} has no run '{name}'; it holds {names}.")

    def to_xarray(self) -> xarray.DataTree:
        """Every run as a dataset in one tree: ``s.to_xarray()["001"]``; see :func:`session_tree`."""
        return session_tree(self.session)

    def diagnose(self, added: Sequence[str] = (), **options: Any) -> DiagnosisView:
        """Which effect is missing; see ``fingerlab.diagnose``."""
        return diagnose(self, added=added, **options)

    def fit(self, effects: Sequence[str] = ()) -> ModelView:
        """The nominal model with these effects, fitted; see ``fingerlab.fit``."""
        return fit(self, effects=effects)

    def reveal(self) -> dict[str, dict[str, float]]:
        """What a simulated session hides: effect id -> parameter -> value, SI.

        Raises:
            UserError: the session was not simulated.
        """
        from fingerlab.twin.session import reveal_session

        found: dict[str, dict[str, float]] = reveal_session(self.path)["effects"]
        return found

    def _parts(self) -> Sequence[Displayable]:
        from fingerlab.report.page_tables import run_rows

        session = self.session
        seconds = sum(run.seconds for run in session.runs)
        when = f", {session.created}" if session.created else ""
        head = f"{session.path.name}: {session.title or 'session'}{when}, {len(self)} runs, {seconds:.0f} s"
        columns = ("runs", "phase", "cable", "motion", "s", "Hz")
        rows = [(r.runs, r.phase, r.cable, r.trajectory, r.seconds, r.rate) for r in run_rows(session)]
        return (head, ShownTable(columns, rows, frozenset({4, 5})))


def open(path: str | Path) -> SessionView:
    """Open a session file; samples are read when they are asked for.

    Raises:
        UserError: the file is missing, damaged, or breaks the session format.
    """
    return SessionView(open_session(path))


def simulate(
    path: str | Path,
    protocol: str = "rich",
    effects: Sequence[str] = (),
    hidden: bool = False,
    seed: int | None = None,
    progress: Progress | None = None,
) -> SessionView:
    """Record a session from the simulated rig into a new file, and open it.

    Args:
        protocol: ``on-air``, ``contact``, ``motor-bench``, ``thesis`` or ``rich``.
        effects: put into the bench, as ``ID`` or ``ID=STRENGTH``.
        hidden: pick an effect (or none) and seal it in the file until ``reveal``.
        seed: same seed, same bench and noise; random for None.

    Raises:
        UserError: the file exists, an unknown protocol or effect, or ``hidden`` with ``effects``.
    """
    from fingerlab.twin.effects import parse_effects
    from fingerlab.twin.protocols import PROTOCOLS, load_preset
    from fingerlab.twin.session import new_seed, write_session

    if protocol not in PROTOCOLS:
        raise UserError(f"There is no protocol '{protocol}'; there are {', '.join(PROTOCOLS)}.")
    if hidden and effects:
        raise UserError("hidden=True picks the effect itself; leave out effects, or leave out hidden.")
    chosen = parse_effects(tuple(effect_ids(effects)))
    preset = load_preset()
    plans = PROTOCOLS[protocol](preset.numbers["protocol"]["contact_amplitude_deg"])
    number = new_seed() if seed is None else seed
    write_session(Path(path), preset, protocol, plans, chosen, number, hidden, progress)
    return open(path)
