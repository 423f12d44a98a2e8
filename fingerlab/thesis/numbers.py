"""The thesis' published numbers, worked out from reduced runs; keys as in ``published``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fingerlab.signals.regions import REGIONS
from fingerlab.thesis.contact import FINAL, ContactRun, PredictionSpec
from fingerlab.thesis.fitting import SessionFit
from fingerlab.thesis.onair import OnAirRun
from fingerlab.thesis.pooling import Spread
from fingerlab.thesis.prediction import AngleStep
from fingerlab.thesis.specs import FOUR_REGIONS, JOINTS, FitSpec, Joint


def published_numbers(
    on_air: Sequence[OnAirRun],
    contact: Sequence[ContactRun[PredictionSpec]],
    fits: Mapping[FitSpec, SessionFit],
    cable: str,
    sweep: Sequence[AngleStep],
) -> Mapping[str, Spread]:
    """Every number of the published table over the runs, in the units of ``published``."""
    numbers = _regressions(fits, cable)
    for method in ("finddelay", "xcorr"):
        numbers[f"delay_{method}"] = Spread(
            tuple(1e3 * run.delays_s["pip"][method] for run in on_air if "pip" in run.delays_s)
        )
    numbers |= _forces(contact)
    for joint in JOINTS:
        numbers[f"speed_change_{joint}"] = _speed_change(on_air, contact, joint)
    numbers["r2_angle_60"] = Spread(tuple(step.r2 for step in sweep if step.angle_deg == 60.0))
    return numbers


def _regressions(fits: Mapping[FitSpec, SessionFit], cable: str) -> dict[str, Spread]:
    def r2(spec: FitSpec, joint: Joint, region: str) -> Spread:
        results = fits[spec].cables.get(cable)
        return results[joint, region].r2 if results is not None else Spread(())

    numbers = {}
    for region in REGIONS:
        by_joint = [r2(FOUR_REGIONS, joint, region) for joint in JOINTS]
        numbers[f"r2_{region}"] = Spread(tuple(v for spread in by_joint for v in spread.values))
        numbers[f"r2_pip_{region}"] = by_joint[JOINTS.index("pip")]
    numbers["r2_extension_finddelay_20"] = r2(
        FitSpec("flexion-extension", "finddelay", 20), "pip", "extension"
    )
    numbers["r2_flexion_findsignal_30"] = r2(FitSpec("flexion-extension", "findsignal", 30), "pip", "flexion")
    return numbers


def _forces(contact: Sequence[ContactRun[PredictionSpec]]) -> dict[str, Spread]:
    def over(spec: PredictionSpec, name: str, scale: float = 1.0) -> Spread:
        found: Iterable[float] = (
            scale * float(getattr(run.predictions[spec], name)) for run in contact if spec in run.predictions
        )
        return Spread(tuple(found))

    extension = PredictionSpec("pip", FOUR_REGIONS, "extension")
    flexion = PredictionSpec("pip", FOUR_REGIONS, "flexion")
    return {
        "r2_force_four_regions": over(PredictionSpec("pip", FOUR_REGIONS, None), "r2"),
        "peak_measured": over(extension, "peak_measured"),
        "peak_extension": over(extension, "peak_modelled"),
        "peak_flexion": over(flexion, "peak_modelled"),
        "peak_share": over(FINAL, "share", 100.0),
        "r2_normalised": over(FINAL, "normalised_r2"),
    }


def _speed_change(
    on_air: Sequence[OnAirRun], contact: Sequence[ContactRun[PredictionSpec]], joint: Joint
) -> Spread:
    """Range of the average period's speed of each contact run against the mean on air, per cent."""
    free = [float(np.ptp(run.curves.speed[joint])) for run in on_air if run.curves is not None]
    held = [float(np.ptp(run.curves.speed[joint])) for run in contact if run.curves is not None]
    return Spread(tuple(100.0 * (value / float(np.mean(free)) - 1.0) for value in held) if free else ())
