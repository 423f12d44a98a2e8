"""What differs from run to run: friction by a share of itself, a tip that sticks by how it was set down."""

from __future__ import annotations

import numpy as np

from fingerlab.diagnosis.features import SET_DOWN
from fingerlab.diagnosis.groups import Group
from fingerlab.diagnosis.model import Model
from fingerlab.sessions.model import Array

WANDER = 0.05
"""Friction differs from run to run by this share, one standard deviation; assumed ("some per cent")."""
SET_DOWN_N = 0.02
"""Force along the load cell's face that a tip which sticks is set down with, from run to run, one standard
deviation; assumed: a tenth of what friction of 0.2 holds at 1 N."""


LEAST_REPEATS = 3
"""Runs of one condition from which on their differences are known to be the runs', not the condition's."""


def own_to_a_run(model: Model, values: Array, told: Array, group: Group, condition: int = 0) -> Array:
    """What one standard deviation of all that a run has of its own adds to the features, (k, parts).

    Args:
        values: of the model's unknowns, (p,).
        told: the features' coefficients at these values, (k,).
        group, condition: to which the run belongs.
    """
    parts = [np.where(mine, WANDER * told, 0.0) for mine in model.wandering]
    place = model.index.get(SET_DOWN)
    repeated = len(group.of_condition(condition)) >= LEAST_REPEATS
    if group.in_contact and repeated and place is not None:
        once = values.copy()
        once[place] = SET_DOWN_N  # the column is linear in it
        parts.append(np.where(model.set_down, model.features(once, group), 0.0))
    parts = [part for part in parts if part.any()]
    return np.stack(parts, axis=1) if parts else np.zeros((len(told), 0))
