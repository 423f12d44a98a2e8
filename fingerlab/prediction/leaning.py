"""An extended model's force as the contact force leans further and further (thesis figure 5.2)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fingerlab.diagnosis.bandwidth import NARROW_RATE_HZ
from fingerlab.prediction.extended import Variant
from fingerlab.prediction.force import contact_runs, contact_stretches, solved_forces
from fingerlab.prediction.judging import judge_stretches
from fingerlab.sessions.model import Session
from fingerlab.thesis.prediction import SWEEP_DEG, AngleStep
from fingerlab.thesis.regression import coefficient_of_determination


def swept(variant: Variant, session: Session, sha256: str, where: str) -> Mapping[str, tuple[AngleStep, ...]]:
    """Peak and R2 at each angle, for every contact run that repeats, by its name.

    The load cell reads the force along its axis; leaning towards the base by an angle, the fingertip also
    pushes along the cell's face with ``-tan(angle)`` of it, beside what the model found there already.

    As in a prediction, a run that the fit has seen is judged by values that have not seen it.

    Args:
        sha256: hash of the session's file. where: the model's name, for the errors' sentences.
    """
    effects = [chosen.alone() for chosen in variant.effects]
    result = {}
    for run in contact_runs(session):
        stretch = max(contact_stretches(session, run), key=lambda one: len(one.time))
        if stretch.frequency_hz == 0.0:
            continue
        values = variant.values_without(sha256, run.name) or variant.values
        steps = []
        for angle in SWEEP_DEG:
            lateral = values.get("lateral", 0.0) - math.tan(math.radians(angle))
            forces = solved_forces(stretch, effects, {**values, "lateral": lateral}, where)
            mixed = variant.pip_weight * forces["pip"] + (1.0 - variant.pip_weight) * forces["mcp"]
            force = np.where(np.isfinite(mixed), mixed, forces["pip"])
            found = judge_stretches(
                [stretch.measured], [force], NARROW_RATE_HZ, stretch.frequency_hz
            ).prediction
            r2 = coefficient_of_determination(found.measured, found.modelled)
            steps.append(AngleStep(angle, found.modelled, found.peak_modelled, r2))
        result[run.name] = tuple(steps)
    return result
