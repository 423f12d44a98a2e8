"""Moment arms and friction losses of a session, by one of the thesis' methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fingerlab.core.errors import UserError
from fingerlab.sessions.model import Run, Session
from fingerlab.thesis.onair import OnAirRun, reduce_run
from fingerlab.thesis.pieces import in_pieces
from fingerlab.thesis.pooling import CableFit, pool
from fingerlab.thesis.specs import FitSpec
from fingerlab.thesis.traces import trace

Progress = Callable[[float, str], None]
"""Called with the share done, 0 to 1, and what is being done; may raise ``Cancelled``."""


@dataclass(frozen=True)
class SessionFit:
    """Fitted parameters of a session, for each cable with which it was moved on air.

    Attributes:
        cables: result of each joint and region, by cable. used: runs that took part, by cable.
        skipped: runs on air that did not, each with the reason in words.
        runs: what was kept of each run, in the order taken.
    """

    session: Path
    spec: FitSpec
    cables: Mapping[str, CableFit]
    used: Mapping[str, tuple[str, ...]]
    skipped: tuple[tuple[str, str], ...]
    runs: tuple[OnAirRun, ...]


def on_air_runs(session: Session) -> tuple[Run, ...]:
    """Runs on air with a cable, in the order taken, long ones in pieces.

    Raises:
        UserError: the session has none.
    """
    runs = in_pieces(run for run in session.runs if run.phase == "on_air" and run.cable_sign != 0)
    if not runs:
        raise UserError(
            f"{session.path} has no run on air with a cable; moment arms and losses are fitted to runs of "
            "phase 'on_air' with an extension or flexion cable."
        )
    return runs


def fit_session(session: Session, spec: FitSpec, progress: Progress | None = None) -> SessionFit:
    """Fit the on-air runs of a session, run by run.

    Runs that do not repeat a trajectory serve the method ``whole`` only; the result says which were left.

    Raises:
        UserError: no run on air, none that repeats where the method needs it, or a method and a delay
            that do not go together.
    """
    if spec.method == "whole" and spec.delay == "findsignal":
        raise UserError(
            "The delay 'findsignal' belongs to a region and the method 'whole' has none; "
            "choose '--method regions' or 'flexion-extension', or '--delay xcorr'."
        )
    reduced = reduce_runs(session, on_air_runs(session), [spec], progress)
    return assemble(session, spec, reduced)


def reduce_runs(
    session: Session, runs: Sequence[Run], specs: Sequence[FitSpec], progress: Progress | None
) -> tuple[OnAirRun, ...]:
    """Each run reduced on its own, so that memory does not grow with the data."""
    reduced = []
    for number, run in enumerate(runs):
        if progress is not None:
            progress(number / len(runs), f"run {run.name}")
        reduced.append(reduce_run(trace(run, session.rig), specs))
    return tuple(reduced)


def assemble(session: Session, spec: FitSpec, reduced: Sequence[OnAirRun], strict: bool = True) -> SessionFit:
    """Pool reduced runs cable by cable.

    Args:
        strict: whether a fit for which no run could be used is an error; else it comes back empty.

    Raises:
        UserError: no run could be used.
    """
    skipped = tuple((run.name, _why_not(run)) for run in reduced if not _usable(run, spec))
    used: dict[str, list[OnAirRun]] = {}
    for run in reduced:
        if _usable(run, spec):
            used.setdefault(run.cable, []).append(run)
    if strict and not used:
        raise UserError(
            f"No on-air run in {session.path} can be used for '{spec.method}' with delay '{spec.delay}' "
            f"(run {skipped[0][0]} {skipped[0][1]}); record a sine of several periods, or choose "
            "'--method whole --delay none'."
        )
    return SessionFit(
        session.path,
        spec,
        {cable: pool(runs, spec) for cable, runs in used.items()},
        {cable: tuple(run.name for run in runs) for cable, runs in used.items()},
        skipped,
        tuple(reduced),
    )


def _usable(run: OnAirRun, spec: FitSpec) -> bool:
    return spec in run.fits and any(fit.line is not None for fit in run.fits[spec].values())


def _why_not(run: OnAirRun) -> str:
    if run.periods == 0:
        return "does not repeat a trajectory over two whole periods"
    return "shows no region in which tension varies"
