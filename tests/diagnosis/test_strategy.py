"""What follows the first effect: nothing where it leaves little at its refined shape.

A path of several effects whose end leaves much is looked for again from its likeliest effect.
"""

from __future__ import annotations

import pytest

from fingerlab.diagnosis.score.fitted_model import FittedModel
from fingerlab.diagnosis.search.first_step import FirstStep, RefinedPath
from fingerlab.diagnosis.search.path import earns_its_steps, one_more_each, worth_a_further_effect
from fingerlab.diagnosis.search.strategy import worth_restarting

from .invented import leaving

TAKEN = "torque_ripple", "presliding_hysteresis"
BEST = leaving(1.0, "presliding_hysteresis")


def path_of(*effects: str, left: float = 0.6) -> list[FittedModel]:
    return [*(leaving(1.0, *effects[:k]) for k in range(len(effects))), leaving(left, *effects)]


@pytest.mark.parametrize(
    ("path", "worth"),
    [
        (path_of(*TAKEN), True),
        (path_of(*TAKEN, left=0.39), False),  # nearly right
        (path_of("presliding_hysteresis"), False),  # one effect alone
        (path_of("torque_ripple", "stiffness_error"), False),  # the best stood for two others
    ],
)
def test_another_beginning_is_looked_for_where_a_path_of_several_leaves_much(
    path: list[FittedModel], worth: bool
) -> None:
    assert worth_restarting(path, BEST, FirstStep([], None)) == worth


def test_a_first_effect_that_its_own_shape_makes_better_is_another_beginning() -> None:
    """It stands no longer in the path: on its grid two others did more."""
    path, best = path_of("torque_ripple", "stiffness_error", left=2.0), leaving(4.0, "joint_stop")
    refined = RefinedPath(best, None, [leaving(9.0), leaving(2.2, "joint_stop")])  # type: ignore[arg-type]
    assert worth_restarting(path, best, FirstStep([leaving(9.0), best], refined))
    assert not worth_restarting(path, best, FirstStep([leaving(9.0), best], None))
    # So it is where one other took its place.
    assert worth_restarting(path_of("viscoelastic_creep"), best, FirstStep([leaving(9.0), best], refined))


@pytest.mark.parametrize(("left", "earned"), [(1.9, False), (1.4, False), (0.75, False), (0.65, True)])
def test_each_effect_of_a_longer_path_explains_two_fifths_of_what_is_left(left: float, earned: bool) -> None:
    """Three effects more must leave less than 0.6 to the power of three of 3.1: 0.67."""
    longer = path_of("torque_ripple", "stiffness_error", "motor_spring", "added_mass", left=left)
    assert earns_its_steps(longer, path_of("joint_stop", left=3.1)) == earned


@pytest.mark.parametrize(("left", "more"), [(0.1, False), (0.19, False), (0.21, True), (0.3, True)])
def test_no_further_effect_is_sought_where_the_first_leaves_little(left: float, more: bool) -> None:
    """A further effect must lower the squared score by 0.2."""
    assert worth_a_further_effect(leaving(left, "capstan_friction")) == more


def test_a_path_adds_one_effect_at_each_step() -> None:
    """Begun with hardening, then harmonic error, hardening made needless by stiffness: two steps are left."""
    hardening, harmonics, stiffness = "spring_hardening", "angle_sensor_nonlinearity", "stiffness_error"
    grown = [(), (hardening,), (hardening, harmonics), (harmonics, stiffness)]
    assert one_more_each([leaving(1.0, *step) for step in grown], 0) is None
    assert one_more_each([leaving(1.0, *step) for step in ((), *grown[1:3])], 0) == [0, 1, 2]
    detour = [(), (hardening,), (harmonics,), (harmonics, stiffness)]
    assert one_more_each([leaving(1.0, *step) for step in detour], 0) == [0, 2, 3]
    # What was given from the start is in every step.
    given = [(stiffness,), (stiffness, hardening), (stiffness, hardening, harmonics)]
    assert one_more_each([leaving(1.0, *step) for step in given], 1) == [0, 1, 2]
