"""One torque of the motor behind four losses, or four losses of their own."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fingerlab.diagnosis.equations.model import Choice, Model, Unknown
from fingerlab.diagnosis.fit.priors import prior_penalty
from fingerlab.effects import CATALOGUE
from fingerlab.physics.parameter import Parameter

RADIUS = 0.015
ROUTINGS = ("extension", "flexion")
ARMS = {
    "arm_mcp@extension": 0.011,
    "arm_pip@extension": 0.008,
    "arm_mcp@flexion": 0.012,
    "arm_pip@flexion": 0.007,
}
SIDES = np.array([-1.0, -1.0, 1.0, 1.0])
LEVERS = np.array(list(ARMS.values()))


def unknown(key: str, spread: float = 1.0) -> Unknown:
    """A nuisance, of one routing or of all, or a gain of an effect."""
    effect, _, gain = key.rpartition(".")
    name, _, cable = gain.partition("@")
    return Unknown(name, Parameter("", -1.0, 1.0, spread), effect, cable)


def holding(effect: str, keys: Iterable[str], spread: float = 1.0) -> Model:
    unknowns = tuple(unknown(key, spread) for key in keys)
    index = {u.key: place for place, u in enumerate(unknowns)}
    assert list(index) == list(keys)
    model: Any = SimpleNamespace(unknowns=unknowns, index=index, choices=(Choice(CATALOGUE[effect]),))
    return cast(Model, model)


def odds(effect: str, losses: np.ndarray, **gains: float) -> float:
    """Twice the log density that four losses (N m) take away from a model with the effect."""
    names = [key.replace("arm", "loss") for key in ARMS]
    known = {
        **dict(zip(names, losses, strict=True)),
        **ARMS,
        **{f"{effect}.{k}": v for k, v in gains.items()},
    }
    return prior_penalty(holding(effect, known), np.array(list(known.values())), RADIUS, ROUTINGS)


def in_favour_of_a_difference(losses: np.ndarray) -> float:
    """The same losses, told as they are and with the one constant torque that leaves least of them."""
    pulls = SIDES * LEVERS / RADIUS
    shift = float(pulls @ losses) / float(pulls @ pulls)
    plain = odds("motor_coulomb_friction", losses, coulomb=5e-3)
    return plain - odds("asymmetric_friction", losses - shift * pulls, coulomb=5e-3, difference=-shift)


def test_one_torque_through_four_moment_arms_is_no_chance() -> None:
    losses = -2.5e-3 * SIDES * LEVERS / RADIUS
    assert in_favour_of_a_difference(losses) > 2 * 3.0
    assert in_favour_of_a_difference(losses + 2e-4 * np.array([1.0, -1.0, 0.5, 0.7])) > 2.0


@pytest.mark.parametrize("scatter", [1e-5, 1e-4, 1e-3])
def test_losses_of_their_own_are_seldom_a_difference(scatter: float) -> None:
    draws = scatter * np.random.default_rng(7).standard_normal((300, 4))
    said = np.array([in_favour_of_a_difference(losses) for losses in draws])
    assert np.mean(said > 0) < 0.2
    assert np.mean(said > 2 * 3.0) < 0.02


def test_a_joint_torque_that_keeps_its_sign_on_either_cable_is_no_difference() -> None:
    assert in_favour_of_a_difference(np.array([1.5e-3, 1e-3, 1.5e-3, 1e-3])) < 0.0


def test_without_losses_the_simpler_effect_comes_first() -> None:
    bench = SimpleNamespace(unknowns=[], choices=(Choice(CATALOGUE["asymmetric_friction"]),))
    assert prior_penalty(cast(Model, cast(Any, bench)), np.zeros(0), 1.0, ()) > 0.0


def test_the_motor_alone_tells_a_difference_from_a_current_that_is_off() -> None:
    """Twice the log density of a normal zero, and of a difference known to that spread and no better."""
    wanted = np.array([2e-4, -1e-4, 1e-4, 2e-4])  # losses that say little
    names = [key.replace("arm", "loss") for key in ARMS]
    spread, zero, coulomb = 3e-4, 9e-4, 5e-3

    def told(effect: str, **known: float) -> float:
        values = {**dict(zip(names, wanted, strict=True)), **ARMS, **known}
        model = holding(effect, values, spread)
        return prior_penalty(model, np.array(list(values.values())), RADIUS, ROUTINGS)

    plain = {"motor_coulomb_friction.coulomb": coulomb}
    off = told("motor_coulomb_friction", torque_zero=zero, **plain)
    assert off - told("motor_coulomb_friction", torque_zero=0.0, **plain) == pytest.approx(
        (zero / spread) ** 2
    )
    both = {"asymmetric_friction.coulomb": coulomb, "asymmetric_friction.difference": zero}
    price = told("asymmetric_friction", torque_zero=0.0, **both)
    price -= told("motor_coulomb_friction", torque_zero=0.0, **plain)
    # The losses scatter by the root of their mean square and 0.2 mN m; each arm turns the torque over RADIUS.
    losses = np.mean(wanted**2) + 2e-4**2
    known = 1 / np.sqrt(1 / spread**2 + np.sum((LEVERS / RADIUS) ** 2) / losses)
    assert price == pytest.approx(2 * np.log(2 * coulomb / (np.sqrt(2 * np.pi) * known)))
