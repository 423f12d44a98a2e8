"""Contact runs, each reduced to what its predictions say."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from fingerlab.sessions.model import Array
from fingerlab.signals.periods import usable
from fingerlab.signals.regions import REGION_TITLES
from fingerlab.thesis.fitting import SessionFit
from fingerlab.thesis.onair import Curves, average_period
from fingerlab.thesis.prediction import ParameterSet, Prediction, judge, predicted_force
from fingerlab.thesis.specs import FOUR_REGIONS, JOINT_TITLES, JOINTS, THESIS_DELAYS, FitSpec, Joint
from fingerlab.thesis.traces import Traces


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
    curves: Curves | None
    predictions: Mapping[Key, Prediction]


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


def sets_for(
    fits: Mapping[FitSpec, SessionFit], cable: str, specs: Sequence[PredictionSpec]
) -> Mapping[PredictionSpec, ParameterSet | None]:
    """The parameter set of each prediction."""
    return {spec: parameter_set(fits[spec.fit], cable, spec.joint, spec.region) for spec in specs}
