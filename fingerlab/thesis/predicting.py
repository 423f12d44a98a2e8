"""Contact force of a session from a fitted model, against the load cell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.thesis.contact import ContactRun, reduce_contact_run
from fingerlab.thesis.examples import Example, example
from fingerlab.thesis.fitting import Progress
from fingerlab.thesis.pieces import in_pieces
from fingerlab.thesis.prediction import AngleStep, ParameterSet, angle_sweep
from fingerlab.thesis.traces import settled, trace


@dataclass(frozen=True)
class SessionPrediction:
    """Every contact run of a session predicted with every parameter set, by the set's name.

    Attributes:
        sweep: contact angles on the first run that repeats, with the set ``sweep_set`` (None: no such run).
        example: a stretch of the first run; ``example_forces`` the modelled forces there, N.
    """

    session: Path
    sets: Mapping[str, ParameterSet]
    runs: tuple[ContactRun[str], ...]
    sweep: tuple[AngleStep, ...]
    sweep_set: str | None
    example: Example
    example_forces: Mapping[str, Array]


def contact_runs(session: Session) -> tuple[Run, ...]:
    """Runs in contact with a cable, in the order taken, long ones in pieces; may be empty."""
    return in_pieces(run for run in session.runs if run.phase == "contact" and run.cable_sign != 0)


def predict_session(
    session: Session, sets: Mapping[str, ParameterSet], progress: Progress | None = None
) -> SessionPrediction:
    """Predict the endpoint force of a session's contact runs, run by run.

    Raises:
        UserError: the session has no contact run.
    """
    runs = contact_runs(session)
    if not runs:
        raise UserError(
            f"{session.path} has no contact run with a cable; the endpoint force is predicted for runs of "
            "phase 'contact'."
        )
    sweep_set = next(
        (name for name, given in sets.items() if given.joint == "pip" and not given.switches), None
    )
    reduced: list[ContactRun[str]] = []
    sweep: tuple[AngleStep, ...] = ()
    shown: tuple[Example, Mapping[str, Array]] | None = None
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number / len(runs), f"run {run.name}")
        traces = settled(trace(run, session.rig))
        contact, forces = reduce_contact_run(traces, sets)
        reduced.append(contact)
        if not sweep and sweep_set is not None and traces.grid is not None:
            sweep = angle_sweep(traces, sets[sweep_set])
        if shown is None:
            stretch = example(run, traces)
            shown = stretch, {name: stretch.cut(force) for name, force in forces.items()}
    assert shown is not None
    return SessionPrediction(session.path, sets, tuple(reduced), sweep, sweep_set if sweep else None, *shown)
