"""Contact runs predicted from parameters fitted on air: the thesis' predictions, and a model file's."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.models.file import SavedModel
from fingerlab.sessions.model import Array, Session
from fingerlab.signals.periods import REGION_TITLES, usable
from fingerlab.thesis.fitting import SessionFit, in_pieces
from fingerlab.thesis.onair import AveragePeriod, Parameters, average_period
from fingerlab.thesis.prediction import (
    AngleStep,
    ForcePrediction,
    ParameterSet,
    angle_sweep,
    judge,
    predicted_force,
)
from fingerlab.thesis.traces import (
    FOUR_REGIONS,
    JOINT_TITLES,
    JOINTS,
    THESIS_DELAYS,
    FitSpec,
    Joint,
    RunExcerpt,
    Traces,
    example,
    settled,
    trace,
)


@dataclass(frozen=True)
class PredictionSpec:
    """Which equation predicts with which parameters; ``region`` None lets the region pick them."""

    joint: Joint
    fit: FitSpec
    region: str | None

    @property
    def title(self) -> str:
        """In words."""
        which = "all regions" if self.region is None else f"{REGION_TITLES[self.region]} parameters"
        return f"{JOINT_TITLES[self.joint]} equation, {which}"


FINAL_FIT = FitSpec("flexion-extension", "findsignal", 10)
"""The parameters that the thesis ended with (figures 4.18 and 4.19), for its extension region."""

FINAL = PredictionSpec("pip", FINAL_FIT, "extension")


def prediction_specs() -> tuple[PredictionSpec, ...]:
    """Every force prediction of the thesis, and the MCP equation, which the thesis left out."""
    specs = [PredictionSpec("pip", FOUR_REGIONS, None)]
    for joint in JOINTS:
        specs += [PredictionSpec(joint, FOUR_REGIONS, region) for region in ("extension", "flexion")]
    for delay in THESIS_DELAYS:
        specs.append(PredictionSpec("pip", FitSpec("flexion-extension", delay, 30), "flexion"))
        specs.append(PredictionSpec("pip", FitSpec("flexion-extension", delay, 10), "extension"))
    return tuple(specs)


Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True)
class ContactRun(Generic[Key]):
    """All that is kept of a contact run. ``speed_range`` in rad/s over the usable samples, by joint.

    ``predictions`` goes by what names a parameter set: a ``PredictionSpec``, or the name of a model's set.
    """

    name: str
    cable: str
    periods: int
    speed_range: Mapping[Joint, float]
    curves: AveragePeriod | None
    predictions: Mapping[Key, ForcePrediction]


def parameter_set(fit: SessionFit, cable: str, joint: Joint, region: str | None) -> ParameterSet | None:
    """Parameters of a fit to predict with; None where the region was not found."""
    found = {
        key[1]: result.pooled
        for key, result in fit.cables.get(cable, {}).items()
        if key[0] == joint and result.pooled is not None and region in (None, key[1])
    }
    if not found:
        return None
    return ParameterSet(region or "all regions", joint, cable, found, fit.spec.threshold)


def reduce_contact_run(
    traces: Traces, sets: Mapping[Key, ParameterSet | None]
) -> tuple[ContactRun[Key], Mapping[Key, Array]]:
    """Predict one contact run with every parameter set.

    Returns:
        What is kept, and the modelled forces, N, shape (n,), which are not.
    """
    forces = {spec: predicted_force(traces, given) for spec, given in sets.items() if given is not None}
    start, stop = usable(len(traces.tension), traces.signals.sample_rate_hz)
    speed_range = {
        joint: float(np.ptp(traces.speed[joint][start:stop])) if stop > start else float("nan")
        for joint in JOINTS
    }
    run = ContactRun(
        traces.signals.run_name,
        traces.cable,
        0 if traces.grid is None else traces.grid.count,
        speed_range,
        None if traces.grid is None else average_period(traces, traces.grid),
        {spec: judge(traces, force) for spec, force in forces.items()},
    )
    return run, forces


FIT_METHODS = ("regions", "flexion-extension", "whole")


def parameter_sets(model: SavedModel, where: str) -> Mapping[str, ParameterSet]:
    """What a model can predict with, by name: every cable and joint, each region, and all together.

    Args:
        where: the model's file, for the error's sentence.

    Raises:
        UserError: the model holds no moment arms, or effects that the thesis' prediction does not know.
    """
    if model.effects:
        raise UserError(
            f"{where} holds the effects {', '.join(model.effects)}, which 'predict' does not evaluate; "
            "use a model written by 'fingerlab fit'."
        )
    if model.method not in FIT_METHODS:
        raise UserError(
            f"{where} is of method '{model.method}' and holds no moment arms; a force prediction needs a "
            "model that 'fingerlab fit' wrote for a session with runs on air."
        )
    threshold = model.details.get("threshold_percent", 10)
    if isinstance(threshold, bool) or not isinstance(threshold, (int, float)) or not 0 <= threshold < 50:
        raise UserError(
            f"{where}, 'threshold_percent' is {threshold!r}; it should be a number from 0 to 50 per cent."
        )
    sets: dict[str, ParameterSet] = {}
    for cable in ("extension", "flexion"):
        for joint in JOINTS:
            regions = _regions(model, cable, joint)
            if model.method == "regions" and len(regions) > 1:
                sets[f"{cable}/{joint}/all_regions"] = ParameterSet(
                    "all regions", joint, cable, regions, float(threshold)
                )
            for region in ("extension", "flexion", "whole"):
                if region in regions:
                    only = {region: regions[region]}
                    sets[f"{cable}/{joint}/{region}"] = ParameterSet(
                        region, joint, cable, only, float(threshold)
                    )
    if not sets:
        raise UserError(
            f"{where} holds no moment arm of a moving region; fit it again to runs that move the joints."
        )
    return sets


def _regions(model: SavedModel, cable: str, joint: Joint) -> Mapping[str, Parameters]:
    regions = {}
    for region in ("flexion", "static_1", "extension", "static_2", "whole"):
        key = f"{cable}/{joint}/{region}"
        arm = model.parameters.get(f"{key}/moment_arm")
        loss = model.parameters.get(f"{key}/friction_loss")
        if arm is None or loss is None:
            continue
        delay = model.parameters.get(f"{key}/delay")
        regions[region] = Parameters(
            joint, region, cable, arm, loss, float("nan"), 0.0 if delay is None else delay.value, 0, ()
        )
    return regions


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
    example: RunExcerpt
    example_forces: Mapping[str, Array]


def predict_session(
    session: Session, sets: Mapping[str, ParameterSet], progress: Progress | None = None
) -> SessionPrediction:
    """Predict the endpoint force of a session's contact runs, run by run.

    Raises:
        UserError: the session has no contact run.
    """
    runs = in_pieces(session.contact_runs())
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
    shown: tuple[RunExcerpt, Mapping[str, Array]] | None = None
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
