"""From a fit to a model file's content, and from there to the parameters that a prediction needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.models.file import Model, ParameterEstimate, hash_sessions
from fingerlab.sessions.model import Session
from fingerlab.thesis.fitting import SessionFit
from fingerlab.thesis.motor_bench import MotorBenchFit
from fingerlab.thesis.pooling import Parameters, Spread
from fingerlab.thesis.prediction import ParameterSet
from fingerlab.thesis.regression import CONFIDENCE
from fingerlab.thesis.specs import JOINTS, Joint

MOTOR_BENCH_METHOD = "motor_bench"
FIT_METHODS = ("regions", "flexion-extension", "whole")


def model_of_fit(session: Session, fit: SessionFit) -> Model:
    """The model file's content; parameters are named ``cable/joint/region/moment_arm`` and so on."""
    parameters: dict[str, ParameterEstimate] = {}
    r2: dict[str, float] = {}
    for cable, results in fit.cables.items():
        for (joint, region), result in results.items():
            if result.pooled is None:
                continue
            key = f"{cable}/{joint}/{region}"
            parameters[f"{key}/moment_arm"] = result.pooled.moment_arm
            parameters[f"{key}/friction_loss"] = result.pooled.loss
            if fit.spec.delay != "none":
                parameters[f"{key}/delay"] = delay_estimate(result.pooled.delay_s, result.delays_s)
            r2[key] = result.pooled.r2
    details: dict[str, Any] = {
        "delay": fit.spec.delay,
        "threshold_percent": fit.spec.threshold,
        "runs": {cable: list(names) for cable, names in fit.used.items()},
        "skipped": [{"run": name, "because": reason} for name, reason in fit.skipped],
        "r2": r2,
    }
    return Model(fit.spec.method, parameters, hash_sessions([session]), details=details)


def delay_estimate(mean: float, delays: Spread) -> ParameterEstimate:
    """Mean delay over runs, s, with the 90 % interval of the mean; NaN bounds for a single run."""
    good = [value for value in delays.values if np.isfinite(value)]
    half = float("nan")
    if len(good) > 1:
        from scipy.stats import t as student  # slow to import

        quantile = float(student.ppf(0.5 + CONFIDENCE / 2, len(good) - 1))
        half = quantile * delays.deviation / float(np.sqrt(len(good)))
    return ParameterEstimate(mean, "s", mean - half, mean + half)


def model_of_motor_bench(session: Session, fit: MotorBenchFit) -> Model:
    """The model file's content of a motor-bench fit."""
    details = {
        "fixed_by_rig": list(fit.fixed),
        "not_shown_by_data": list(fit.absent),
        "r2": fit.r2,
        "rmse": fit.rmse,
        "run_r2": dict(fit.run_r2),
    }
    return Model(MOTOR_BENCH_METHOD, fit.parameters, hash_sessions([session]), details=details)


def parameter_sets(model: Model, where: str) -> Mapping[str, ParameterSet]:
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
    sets: dict[str, ParameterSet] = {}
    threshold = _threshold(model, where)
    for cable in ("extension", "flexion"):
        for joint in JOINTS:
            regions = _regions(model, cable, joint)
            if model.method == "regions" and len(regions) > 1:
                sets[_name(joint, "all regions", cable)] = ParameterSet(
                    "all regions", joint, cable, regions, threshold
                )
            for region in ("extension", "flexion", "whole"):
                if region in regions:
                    only = {region: regions[region]}
                    sets[_name(joint, region, cable)] = ParameterSet(region, joint, cable, only, threshold)
    if not sets:
        raise UserError(
            f"{where} holds no moment arm of a moving region; fit it again to runs that move the joints."
        )
    return sets


def _name(joint: Joint, region: str, cable: str) -> str:
    return f"{cable}/{joint}/{region.replace(' ', '_')}"


def _threshold(model: Model, where: str) -> float:
    value = model.details.get("threshold_percent", 10)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value < 50:
        raise UserError(
            f"{where}, 'threshold_percent' is {value!r}; it should be a number from 0 to 50 per cent."
        )
    return float(value)


def _regions(model: Model, cable: str, joint: Joint) -> Mapping[str, Parameters]:
    regions = {}
    for region in ("flexion", "static_1", "extension", "static_2", "whole"):
        key = f"{cable}/{joint}/{region}"
        arm = model.parameters.get(f"{key}/moment_arm")
        loss = model.parameters.get(f"{key}/friction_loss")
        if arm is None or loss is None:
            continue
        delay = model.parameters.get(f"{key}/delay")
        regions[region] = Parameters(
            joint,
            region,
            cable,
            arm,
            loss,
            float("nan"),
            0.0 if delay is None else delay.value,
            0,
            (),
        )
    return regions
