"""A drafted law as a diagnosis would give it, without one."""

from __future__ import annotations

import numpy as np

from fingerlab.core.text import ParameterEstimate
from fingerlab.diagnosis.answer.results import Fingerprint
from fingerlab.diagnosis.draft.laws import DraftLaw, LawTerm, cause
from fingerlab.diagnosis.draft.library import library
from fingerlab.diagnosis.draft.terms import PLACES

TRAVEL = {"mcp": (-0.2, 0.9), "pip": (-0.3, 1.1)}  # rad


def invented_law(
    name: str = "draft_motor_speed_squared", size: float = 2e-3, score: float = 1.04
) -> DraftLaw:
    """One term of the library with a coefficient, and what is seen of it."""
    term = next(one for one in library(TRAVEL, True, False, (4.0,), 1.0, 1.0) if one.id == name)
    found = {gain: ParameterEstimate(size, unit, 0.9 * size, 1.1 * size)
             for gain, unit in zip(term.gains, term.units, strict=True)}  # fmt: skip
    told = LawTerm(
        term.place, PLACES[term.place].title, term.words, term.parts[0].latex, term.variables, found,
        dict.fromkeys(found, size), term,
    )  # fmt: skip
    speed = np.linspace(-2.0, 2.0, 15)
    curve = size * speed * np.abs(speed)
    seen = Fingerprint(
        "pip_torque", "motor speed", "rad/s", "N m", speed, curve * 1.02, curve - 1e-4, curve + 1e-4, curve
    )
    law = DraftLaw(
        (told,), (), 3.1, score, (score,), "motor_viscous_friction", 1.9, cause([told]), None, seen  # type: ignore[arg-type]
    )  # fmt: skip
    return law
