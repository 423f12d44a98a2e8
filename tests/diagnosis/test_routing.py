"""The tie between the two cables' moment arms: free inside its reach, a steep wall beyond."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.equations.parameters import spread_of, tie
from fingerlab.diagnosis.score.fitted_model import at_bound
from fingerlab.diagnosis.settings import ARM_RATIO_SPREADS, USUAL_RATIOS, USUAL_SPREAD
from fingerlab.rig.file import Motor, Rig

INDEX = {
    "loss_mcp@flexion": 0, "arm_mcp@extension": 1, "arm_pip@extension": 2, "arm_mcp@flexion": 3,
    "arm_pip@flexion": 4,
}  # fmt: skip


def arms(mcp: float, pip: float) -> np.ndarray:
    """Extension arms of 10 and 8 mm; flexion arms that are off the usual ratio by these logarithms."""
    a, b = 0.010, 0.008
    flexion = (a * USUAL_RATIOS[0] * np.exp(mcp), b * USUAL_RATIOS[1] * np.exp(pip))
    return np.array([0.001, a, b, *flexion])


def test_arms_of_the_recordings_that_the_project_did_not_make_are_free() -> None:
    """The most unlike pairs of ratios among thirteen benches, and the usual one, cost nothing."""
    held = tie(INDEX, USUAL_SPREAD)
    assert held is not None
    for mcp, pip in ((1.008, 0.613), (1.319, 0.731), (0.974, 0.702), (1.052, 0.776), USUAL_RATIOS):
        values = np.array([0.0, 0.010, 0.008, 0.010 * mcp, 0.008 * pip])
        assert held.cost(values) == 0.0
        gradient, curvature = held.expansion(values)
        assert not gradient.any()
        assert not curvature.any()


def test_a_swap_of_the_arms_is_beyond_the_edge() -> None:
    held = tie(INDEX, USUAL_SPREAD)
    assert held is not None
    # 40 % less at MCP and 20 % more at PIP: log distances 0.51 and 0.18, together 0.54, the reach 0.33.
    assert held.cost(arms(np.log(0.6), np.log(1.2))) == pytest.approx(
        1e7 * (np.hypot(np.log(0.6), np.log(1.2)) - ARM_RATIO_SPREADS * USUAL_SPREAD) ** 2
    )
    edge = ARM_RATIO_SPREADS * USUAL_SPREAD
    assert held.cost(arms(-0.999 * edge, 0.0)) == 0.0
    assert held.cost(arms(0.0, 1.001 * edge)) > 0.0


def test_gradient_and_curvature_are_finite_differences() -> None:
    held = tie(INDEX, USUAL_SPREAD)
    assert held is not None
    values = arms(-0.4, 0.25)
    gradient, curvature = held.expansion(values)
    step = 1e-7
    for i in range(len(values)):
        up, down = values.copy(), values.copy()
        up[i] += step
        down[i] -= step
        slope = (held.cost(up) - held.cost(down)) / (2 * step)
        assert 2 * gradient[i] == pytest.approx(slope, rel=1e-5, abs=1e-3)
    # In logarithms of the arms the curvature is exact; the arms' own bend is left out, as in Gauss-Newton.
    logs = np.diag(values) @ curvature @ np.diag(values)
    for i in range(1, 5):
        up, down = values.copy(), values.copy()
        up[i] *= np.exp(1e-5)
        down[i] *= np.exp(-1e-5)
        bend = (held.expansion(up)[0] * up - held.expansion(down)[0] * down) / 2e-5
        assert logs[i] == pytest.approx(bend, rel=1e-4, abs=1.0)
    assert np.linalg.eigvalsh(curvature).min() > -1e-3 * np.linalg.eigvalsh(curvature).max()


def test_one_cable_alone_is_not_tied() -> None:
    assert tie({k: i for i, k in enumerate(INDEX) if "extension" in k}, USUAL_SPREAD) is None


def test_a_rig_file_may_know_its_finger_better() -> None:
    assert spread_of(Rig(None, Motor(), {"moment_arm": 0.03})) == 0.03
    assert spread_of(Rig(None, Motor())) == USUAL_SPREAD


def test_a_value_between_its_bounds_stands_at_neither() -> None:
    """An arm of 13 mm, thought to be from 2 to 40: six times the lower bound had passed for it."""
    assert not at_bound(0.0129, 0.002, 0.04)
    assert at_bound(0.002, 0.002, 0.04)
    assert at_bound(0.04, 0.002, 0.04)
    assert at_bound(-2.4999, -2.5, 2.5)
    assert not at_bound(0.0, 0.0, 2.5)  # a bound of zero is a matter of sign
