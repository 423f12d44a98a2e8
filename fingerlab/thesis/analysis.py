"""Chapters 4 and 5 of the thesis on a session: every number of the published table, in one call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fingerlab.sessions.model import Array, Run, Session
from fingerlab.thesis.contact import (
    FINAL,
    ContactRun,
    PredictionSpec,
    prediction_specs,
    reduce_contact_run,
    sets_for,
)
from fingerlab.thesis.examples import Example, example
from fingerlab.thesis.fitting import Progress, SessionFit, assemble, on_air_runs
from fingerlab.thesis.numbers import published_numbers
from fingerlab.thesis.onair import OnAirRun, reduce_run
from fingerlab.thesis.predicting import contact_runs
from fingerlab.thesis.prediction import AngleStep, ParameterSet, angle_sweep
from fingerlab.thesis.published import Quantity, beside_published
from fingerlab.thesis.specs import (
    FOUR_REGIONS,
    FitSpec,
    thesis_specs,
)
from fingerlab.thesis.traces import trace


@dataclass(frozen=True)
class ThesisAnalysis:
    """The thesis' analysis of one session.

    Attributes:
        cable: the cable whose on-air runs gave the parameters (extension, as in the thesis, if there).
        fits: pooled and single fits by spec; ``fits[FOUR_REGIONS]`` is always there.
        on_air, contact: what was kept of the runs that took part. sweep: contact angles on the
            first contact run that repeats.
        quantities: every number of the published table, ours beside the thesis'.
        example_on_air, example_contact: stretches for the figures; ``example_forces`` the modelled forces
            (N) of the latter.
    """

    session: Path
    cable: str
    fits: Mapping[FitSpec, SessionFit]
    on_air: tuple[OnAirRun, ...]
    contact: tuple[ContactRun[PredictionSpec], ...]
    sweep: tuple[AngleStep, ...]
    quantities: tuple[Quantity, ...]
    example_on_air: Example
    example_contact: Example | None
    example_forces: Mapping[PredictionSpec, Array]

    def quantity(self, key: str) -> Quantity:
        """The number of the published table with this key."""
        return next(q for q in self.quantities if q.key == key)


@dataclass(frozen=True)
class _Contacts:
    runs: tuple[ContactRun[PredictionSpec], ...]
    sweep: tuple[AngleStep, ...]
    shown: Example | None
    modelled: Mapping[PredictionSpec, Array]


_Step = Callable[[int, Run], None]


def thesis_analysis(session: Session, progress: Progress | None = None) -> ThesisAnalysis:
    """Run chapters 4 and 5 on a session, run by run.

    Args:
        progress: called with the share done and the run at work; may raise ``Cancelled``.

    Raises:
        UserError: no on-air run repeats a trajectory, or a channel or constant is missing.
    """
    air, contact = on_air_runs(session), contact_runs(session)

    def step(number: int, run: Run) -> None:
        if progress is not None:
            progress(number / (len(air) + len(contact)), f"run {run.name}")

    reduced, shown = _reduce_on_air(session, air, step)
    cable = "extension" if any(run.cable == "extension" for run in reduced) else "flexion"
    ours = tuple(run for run in reduced if run.cable == cable)
    fits = {spec: assemble(session, spec, ours, strict=spec == FOUR_REGIONS) for spec in thesis_specs()}
    sets = sets_for(fits, cable, prediction_specs())
    contacts = _reduce_contact(session, contact, sets, lambda i, run: step(len(air) + i, run))
    return ThesisAnalysis(
        session.path,
        cable,
        fits,
        ours,
        contacts.runs,
        contacts.sweep,
        beside_published(published_numbers(ours, contacts.runs, fits, cable, contacts.sweep)),
        shown,
        contacts.shown,
        contacts.modelled,
    )


def _reduce_on_air(
    session: Session, runs: Sequence[Run], step: _Step
) -> tuple[tuple[OnAirRun, ...], Example]:
    """Every on-air run reduced, and a stretch of the first that repeats (else of the first)."""
    reduced: list[OnAirRun] = []
    shown: Example | None = None
    settled = False
    for number, run in enumerate(runs):
        step(number, run)
        traces = trace(run, session.rig)
        reduced.append(reduce_run(traces, thesis_specs()))
        if shown is None or (not settled and traces.grid is not None):
            shown, settled = example(run, traces), traces.grid is not None
    assert shown is not None  # on_air_runs gives at least one
    return tuple(reduced), shown


def _reduce_contact(
    session: Session, runs: Sequence[Run], sets: Mapping[PredictionSpec, ParameterSet | None], step: _Step
) -> _Contacts:
    """Every contact run predicted; the first is shown and swept over contact angles."""
    reduced: list[ContactRun[PredictionSpec]] = []
    sweep: tuple[AngleStep, ...] = ()
    shown: Example | None = None
    modelled: Mapping[PredictionSpec, Array] = {}
    for number, run in enumerate(runs):
        step(number, run)
        traces = trace(run, session.rig)
        contact, forces = reduce_contact_run(traces, sets)
        reduced.append(contact)
        final = sets[FINAL]
        if not sweep and traces.grid is not None and final is not None:
            sweep = angle_sweep(traces, final)
        if shown is None:
            shown = example(run, traces)
            modelled = {spec: shown.cut(force) for spec, force in forces.items()}
    return _Contacts(tuple(reduced), sweep, shown, modelled)
