"""What an effect must explain for adding it to be a step worth taking.

All hypotheses are compared on the same held-out runs under the same weights. Log evidence is minus half the
misfit over a *temperature*: what no model explains is systematic and stays the same for about a second, so
that samples a cycle apart are not new evidence. Temperature 1 is white noise at the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

from fingerlab.diagnosis.trial import Trial

CORRELATED_VALUES = 16.0
"""Independent noise values within one correlation time (about a second) of a systematic misfit; assumed."""
EARNED_SHARE = 0.001
"""Share of the explained misfit that every further unknown gains by chance and bias."""
LEAST_SHARE = 0.2
"""A missing effect must explain this share of the reproducible misfit, or nothing is missing."""
LEAST_FALL = 0.05
"""... and lower the squared score by this much: below, the misfit is a matter of sensor steps."""
LEAST_FALL_BEYOND = 0.2
"""The same for a model that holds an effect already: its own law is never quite the plant's."""
CONTACT_CHARGE = 0.1
"""... and by this much more where it explains runs in contact alone: how a tip rubs and settles is never
described to the end, and a lean of the force takes up what is left."""
CONTACT_SHARE = 0.6
"""An effect of whose gain this share lies in contact explains the contact."""
NEXT_SHARE = 0.4
"""A second effect must explain more of what is left: the first one's own law is never quite the plant's
(where a joint sticks, say), and a partner that only mends that law is not missing physics."""
DECIDING_LOG_ODDS = 5.0
"""Log odds that decide (about 150 to 1)."""
MUCH = 1.0
"""Squared score above one that no bench leaves (``USUAL_LEFT``) and no nearly right law (about 0.5)."""
NEARLY_RIGHT = 0.4
"""Squared score above one up to which several effects together are taken for right; assumed."""


def justified(base: Trial, trial: Trial, level: float = 0.0) -> bool:
    """Whether adding the trial's last effect to ``base`` is a step that the held-out runs bear out.

    ``level`` is added to the trial's misfit where the two are seen under different weights. That a further
    effect lowers the floor makes it likelier, but explains nothing of what the first one left.
    """
    fall = base.misfit - trial.misfit - level
    explained = min(fall, fall + level) if base.model.choices else fall
    heat = temperature(trial.misfit, trial.count)
    in_contact = contact_charge(base, trial)
    likely = 0.5 * (fall - charge(base, trial) - in_contact * trial.count) / heat > DECIDING_LOG_ODDS
    return bool(likely and explained > least_explained(base, base.misfit, base.count, in_contact))


def idle_steps(steps: Sequence[Trial]) -> list[int]:
    """Numbers of the steps of a path that the one before does not justify; 0 is the model as given."""
    return [k for k in range(1, len(steps)) if not justified(steps[k - 1], steps[k])]


def least_fall(base: Trial) -> float:
    """By how much the misfit must fall for an effect beyond ``base`` to be worth a step."""
    return least_explained(base, base.misfit, base.count)


def least_explained(base: Trial, misfit: float, count: float, in_contact: float = 0.0) -> float:
    """What an effect beyond ``base`` must explain of a misfit of ``count`` values.

    Args:
        in_contact: see :func:`contact_charge`.
    """
    beyond = bool(base.model.choices)
    least = (LEAST_FALL_BEYOND if beyond else LEAST_FALL) + in_contact
    return max((NEXT_SHARE if beyond else LEAST_SHARE) * misfit, least * count)


def freedom(trial: Trial) -> int:
    """Unknowns that the trial's last effect brings: gains, and one for a grid of shapes."""
    effect = trial.model.choices[-1].effect
    gains = len(trial.model.last_gains) - len(effect.offsets)  # what the losses could be explains no misfit
    return gains + len(effect.relaxes) + (1 if len(effect.shapes) > 3 else 0)


def charge(base: Trial, trial: Trial) -> float:
    """What is added to a trial's misfit for the unknowns that its last effect brings."""
    earned = EARNED_SHARE * freedom(trial) * max(max(base.misfit, 0.0) - trial.misfit, 0.0)
    return earned + max(trial.widening - base.widening, 0.0)


def contact_charge(base: Trial, trial: Trial) -> float:
    """By how much more the squared score must fall for an effect that explains runs in contact alone."""
    if trial.model.choices[-1].effect.phases == ("contact",):
        return CONTACT_CHARGE
    fall, there = base.misfit - trial.misfit, base.misfit_in_contact - trial.misfit_in_contact
    return CONTACT_CHARGE if fall > 0 and there > CONTACT_SHARE * fall else 0.0


def temperature(misfit: float, count: float) -> float:
    """How much less than its face value a misfit weighs (see the module's text)."""
    return 1.0 + CORRELATED_VALUES * max(misfit, 0.0) / max(count, 1.0)


def much_left(trial: Trial, much: float = MUCH) -> bool:
    """Whether a model leaves so much that something is missing for certain."""
    return trial.misfit > much * trial.count
