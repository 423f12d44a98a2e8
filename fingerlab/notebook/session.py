"""A session, its runs, what they recorded and what a diagnosis says of it, as a notebook shows them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import printed, score_text, screen_unit
from fingerlab.diagnosis.answer.results import Candidate, Diagnosis, OtherModel
from fingerlab.effects.base import Effect
from fingerlab.notebook.model import (
    Displayable,
    Displayed,
    Figures,
    ModelView,
    SessionSource,
    ShownTable,
    effect_ids,
    fit,
    opened,
)
from fingerlab.report import diagnosis_words as words
from fingerlab.report.page_tables import error_rows, short_ranking
from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.reading import open_session

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


class EffectView(Displayed):
    """One effect. ``effect`` is the object behind it (``fingerlab.effects.Effect``)."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect

    @property
    def id(self) -> str:
        """What ``added`` and ``--add`` call it."""
        return self.effect.id

    @property
    def title(self) -> str:
        """What the screen calls it."""
        return self.effect.title

    @property
    def changes(self) -> str:
        """The families of equations that it changes, in words."""
        return words.listed([words.FAMILY_TITLES.get(e, e).lower() for e in self.effect.acts_on])

    def _parts(self) -> Sequence[Displayable]:
        one = self.effect
        rows = [
            (name, gain.title or name, gain.unit, f"{gain.low:g} to {gain.high:g}", gain.source)
            for name, gain in one.unknowns.items()
        ]
        parts: list[Displayable] = [f"{one.title} ({one.id}), changes {self.changes}", one.explanation]
        if rows:
            parts.append(ShownTable(("unknown", "what", "unit", "plausible range", "source"), rows))
        return (*parts, f"What reveals it: {one.reveal}.")


class Catalogue(Mapping[str, EffectView], Displayed):
    """Effects by id, one's own included."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = {name: EffectView(one) for name, one in effects.items()}

    def __getitem__(self, effect: str) -> EffectView:
        return self._effects[effect]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def _parts(self) -> Sequence[Displayable]:
        rows = [(one.id, one.title, one.changes) for one in self.values()]
        return (f"{len(self)} effects", ShownTable(("id", "effect", "acts on"), rows))


class DiagnosisView(Displayed):
    """The answer to: which effect is missing? ``result`` holds all of it (``diagnosis.answer.results``)."""

    def __init__(self, result: Diagnosis, sessions: Sequence[Session]) -> None:
        self.result = result
        self._sessions = tuple(sessions)

    @property
    def verdict(self) -> str:
        """``missing_effect``, ``nothing_missing`` or ``not_in_catalogue``."""
        return self.result.verdict

    @property
    def missing(self) -> tuple[str, ...]:
        """Ids of the effects that these data cannot tell apart, best first; empty where none is missing."""
        return words.suspects(self.result)

    @property
    def left_open(self) -> tuple[str, ...]:
        """Where none is missing: ids of the effects that these data could not have shown, likeliest first."""
        return words.not_shown(self.result)

    @property
    def score(self) -> float:
        """Error of the model as given on runs left out of the fit; 1 is the bench's own repeatability."""
        return self.result.score

    @property
    def path(self) -> tuple[tuple[str | None, float], ...]:
        """Effect added and the score with it, step by step; the first is the model as given."""
        return tuple((step.added, step.score) for step in self.result.path)

    @property
    def better(self) -> OtherModel | None:
        """A model with given effects exchanged that is clearly better; None: there is none."""
        return self.result.better

    def candidate(self, effect: str) -> Candidate:
        """How one effect of the catalogue was judged: score, probability, parameters, explanation.

        Raises:
            UserError: the effect was not tried on these sessions.
        """
        for one in self.result.candidates:
            if one.effect == effect:
                return one
        tried = ", ".join(c.effect for c in self.result.candidates)
        raise UserError(f"'{effect}' was not tried on these sessions; those that were: {tried}.")

    def figures(self) -> Figures:
        """Error path, where the model fails worst, measured against modelled, fingerprints.

        Raises:
            UserError: the diagnosis was asked for without curves.
        """
        if not self.result.comparisons:
            raise UserError("This diagnosis holds no curves; ask for it with curves=True to draw figures.")
        from fingerlab.report.diagnosis_figures import diagnosis_figures

        return Figures(diagnosis_figures(self.result))

    def fit(self, effects: Sequence[str] | None = None) -> ModelView:
        """Fit the model to the same sessions, where none are named with the effects that it adds."""
        chosen = self.result.final_model if effects is None else effects
        return fit(*self._sessions, effects=chosen)

    def to_json(self) -> Mapping[str, Any]:
        """What ``fingerlab diagnose --json`` writes."""
        return self.result.to_json()

    def _parts(self) -> Sequence[Displayable]:
        result = self.result
        parts: list[Displayable] = [words.verdict_sentence(result), _errors(result), _ranking(result)]
        best = words.suspected(result)
        parts += [f"{candidate.title}: {printed(candidate.explanation)}" for candidate in best]
        if len(result.set) > 1 or words.not_shown(result):
            parts.append(words.set_sentence(result))
        if words.as_good_sentence(result):
            parts.append(words.as_good_sentence(result))
        if result.paired:
            parts.append(words.paired_sentence(result))
        if words.worth_adding(result):
            parts.append(words.path_sentence(result))
        parts += [f"The bench: {finding.text}" for finding in result.bench]
        proposal = words.next_experiment_sentence(result)
        if proposal is not None:
            parts.append(proposal)
        unseen = words.hidden_sentence(result)
        if unseen:
            parts.append(unseen)
        told = words.calibration_sentence(result)
        if told:
            parts.append(told)
        return parts


def _errors(result: Diagnosis) -> ShownTable:
    rows = [(r.title, r.error, r.floor, r.unit, r.times, r.r2) for r in error_rows(result.errors)]
    columns = ("equations", "error (rms)", "floor", "unit", "error / floor", "R2")
    title = f"Error on {words.judged_on(result).rstrip(',')}: {score_text(result.score)} times the floor"
    return ShownTable(columns, rows, frozenset({1, 2, 4, 5}), title)


def _ranking(result: Diagnosis) -> ShownTable:
    rows = [(r.chance, r.score, "*" if r.in_set else "", r.title, r.effect) for r in short_ranking(result)]
    columns = ("probability", "error", "", "effect or outcome", "id")
    note = "; * cannot be ruled out" if result.set else ""
    return ShownTable(columns, rows, frozenset({0, 1}), f"error: with that effect in the model{note}")


def catalogue() -> Catalogue:
    """The catalogue of effects by id, with those of one's own that have been confirmed."""
    from fingerlab.effects import whole_catalogue

    return Catalogue(whole_catalogue())


def diagnose(
    *sessions: SessionSource,
    added: Sequence[str] = (),
    curves: bool = True,
    progress: Progress | None = None,
) -> DiagnosisView:
    """Where the model fails on these sessions together, and which effect is missing.

    Args:
        sessions: opened, or files. added: ids of effects that the model holds already.
        curves: whether figures are wanted of it.
        progress: called with the share done (0 to 1) and what is being done.

    Raises:
        UserError: no session, an unknown effect, or a run that cannot be read.
    """
    from fingerlab.diagnosis import diagnose as run

    read = [opened(one) for one in sessions]
    return DiagnosisView(run(read, effect_ids(added), progress=progress, with_curves=curves), read)


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


class RunView(Displayed):
    """One run. ``run`` is the object behind it (``fingerlab.sessions.Run``)."""

    def __init__(self, run: Run) -> None:
        self.run = run

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
        return channel_figure(self.run, channels)

    def _parts(self) -> Sequence[Displayable]:
        from fingerlab.report.diagnosis_words import PHASE_WORDS
        from fingerlab.sessions.trajectory import run_told

        run = self.run
        cable = "no cable" if run.cable == "none" else f"{run.cable} cable"
        line = (
            f"run {run.name}: {PHASE_WORDS.get(run.phase, run.phase)}, {cable}, "
            f"{run_told(run)}; {run.seconds:.1f} s at {run.sample_rate_hz:g} Hz"
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
        return tuple(RunView(run) for run in self.session.runs)

    def __len__(self) -> int:
        return len(self.session.runs)

    def __iter__(self) -> Iterator[RunView]:
        return iter(self.runs)

    def __getitem__(self, name: str) -> RunView:
        for run in self.session.runs:
            if run.name == name:
                return RunView(run)
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
