"""What a number did over sessions: closed form against numerical integration, and each law where it is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import logsumexp

from fingerlab.batch import laws
from fingerlab.batch.laws import Course, Prior, course, quantiles
from fingerlab.sessions.model import Array

WEEK = np.arange(8.0)
SITTINGS = np.array([0.0, 0.02, 0.04, 0.06, 3.0, 3.02, 3.04, 3.06])  # of half an hour, days


def told(values: Array, days: Array = WEEK, error: float = 0.05, absent: bool = False) -> Course:
    found = course(days, values, np.full(len(values), error), Prior(0.0, 1.0, absent, 0.2))
    assert found is not None
    return found


def noise(seed: int, count: int = 8) -> Array:
    return 0.05 * np.random.default_rng(seed).standard_normal(count)


def test_the_evidence_is_that_of_a_numerical_integration(monkeypatch: pytest.MonkeyPatch) -> None:
    """One scatter and one size: level and change are integrated on a grid, law by law, as they are meant."""
    monkeypatch.setattr(laws, "SIZES", (1.0,))
    monkeypatch.setattr(laws, "SCATTERS", 1)
    monkeypatch.setattr(laws, "SHARED", {1.0: 1.0})
    days, values, error = np.array([0.0, 1.0, 4.0, 5.0]), np.array([0.3, 0.4, 0.7, 0.65]), 0.2
    found = course(days, values, np.full(4, error), Prior(0.0, 1.0, False, 0.2))
    assert found is not None
    spread = math.hypot(error, 0.02 * error)
    level = np.linspace(-10.0, 10.0, 2001)[:, None]
    change = np.linspace(-5.0, 5.0, 1001)[None, :]
    prior = -0.5 * (level / 2.0) ** 2 - 0.5 * change**2 - math.log(2.0 * math.pi * 2.0)
    cell = math.log(0.01 * 0.01)

    def evidence(x: Array) -> float:
        each = [-0.5 * ((y - level - change * by) / spread) ** 2 for y, by in zip(values, x, strict=True)]
        return float(logsumexp(sum(each) + prior) + cell - 4.0 * math.log(spread * math.sqrt(2.0 * math.pi)))

    index = np.arange(4)
    steps = [evidence(index >= k) for k in (1, 2, 3)]
    lines = [evidence(days / 5.0), evidence(index / 3.0)]
    settling = [
        evidence((1.0 - np.exp(-index / 3.0 / s)) / (1.0 - np.exp(-1.0 / s))) for s in (0.08, 0.16, 0.32)
    ]
    odd = [evidence(index == k) for k in range(4)]
    shares = {"steady": 0.8, "step": 0.2 * 0.30 / 0.88, "wear": 0.2 * 0.20 / 0.88}
    shares |= {"settling": 0.2 * 0.08 / 0.88, "odd": 0.2 * 0.30 / 0.88}  # no sitting has two: none warms up
    every = {
        "steady": [evidence(0.0 * index)],
        "step": steps,
        "wear": lines,
        "settling": settling,
        "odd": odd,
    }
    odds = {kind: shares[kind] * float(np.mean(np.exp(each))) for kind, each in every.items()}
    for kind, one in odds.items():
        assert found.chances[kind] == pytest.approx(one / sum(odds.values()), rel=2e-4), kind
    assert found.places[1:] == pytest.approx(np.exp(steps) / np.exp(steps).sum(), rel=1e-4)
    assert found.odd == pytest.approx(np.exp(odd) / np.exp(odd).sum(), rel=1e-4)


def test_each_law_is_told_where_it_is() -> None:
    at = np.arange(8)
    assert told(2.0 + noise(1)).verdict in ("steady", "open")
    step = told(2.0 + (at >= 3) + noise(2))
    assert (step.verdict, step.place) == ("step", 3)
    new = told((at >= 5) + noise(3), absent=True)
    assert (new.verdict, new.place, new.first.value) == ("new", 5, 0.0)
    gone = told(1.0 * (at < 4) + noise(4), absent=True)
    assert (gone.verdict, gone.place, gone.last.value) == ("gone", 4, 0.0)
    assert told(2.0 + at / 7.0 + noise(5)).verdict == "wear"
    assert told(2.0 - np.exp(-at / 1.2) + noise(6)).verdict == "settling"
    odd = told(2.0 + (at == 4) + noise(7))
    assert (odd.verdict, int(np.argmax(odd.odd))) == ("odd", 4)


def test_what_comes_back_after_a_pause_is_temperature_and_not_wear() -> None:
    warm = 1.0 - np.exp(-(SITTINGS % 3.0) * 1440.0 / 30.0)
    found = told(2.0 + warm + noise(12), SITTINGS)
    assert found.verdict == "warm_up"
    assert found.size.low <= warm.max() <= found.size.high
    assert told(2.0 + warm + noise(8)).chances["warm_up"] == 0.0  # a day between sessions: nothing stays warm


def test_a_last_session_that_is_otherwise_cannot_be_told_from_one_that_went_wrong() -> None:
    found = told(2.0 + (np.arange(8) == 7) + noise(9))
    assert found.verdict == "open"
    assert found.chances["steady"] < 0.1
    assert found.step == pytest.approx(found.chances["odd"], rel=0.5)


@pytest.mark.parametrize("values", [[0.0, 1.0, 1.05], [0.0, 0.05, 1.0], [0.1, 0.0, 0.12, 0.05]])
def test_three_or_four_sessions_tell_nothing(values: list[float]) -> None:
    found = course(
        np.arange(float(len(values))), np.array(values), np.full(len(values), 0.1), Prior(0.0, 1.0)
    )
    assert found is not None
    assert found.verdict == "open"


def test_nine_intervals_in_ten_hold_the_size() -> None:
    rng, inside, told_as_step = np.random.default_rng(10), 0, 0
    for _ in range(150):
        values = 2.0 + 0.5 * (WEEK >= 4) + 0.05 * rng.standard_normal(8)
        found = told(values)
        if found.verdict == "step":
            told_as_step += 1
            inside += found.size.low <= 0.5 <= found.size.high
    assert told_as_step > 120
    assert 0.84 < inside / told_as_step < 0.99


def test_what_all_sessions_have_in_common_moves_the_level_and_not_the_step() -> None:
    """Sessions that scatter far less than their intervals: the level stays as uncertain as these."""
    found = told(2.0 + (WEEK >= 4) + 0.1 * noise(11), error=0.2)
    assert found.verdict == "step"
    assert found.first.high - found.first.low > 0.4
    assert found.size.high - found.size.low < 0.2


def test_a_mixture_of_two_normal_distributions_has_its_quantiles() -> None:
    found = quantiles(np.array([0.0, 10.0]), np.array([1.0, 1.0]), np.array([0.9, 0.1]))
    assert found.low == pytest.approx(-1.593, abs=1e-3)  # Phi(-1.593) = 0.05 / 0.9
    assert found.value == pytest.approx(0.1397, abs=1e-3)  # Phi(0.1397) = 0.5 / 0.9
    assert found.high == pytest.approx(10.0, abs=1e-3)


def test_many_sessions_are_weighed_as_few_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """From sixty on, errors that count nothing are left out beforehand: the answer is the same."""
    days = np.arange(90.0)
    values = 2.0 + 0.03 * (days >= 55) + noise(13, 90)
    few = told(values, days)
    monkeypatch.setattr(laws, "MANY", 1000)
    whole = told(values, days)
    assert few.chances == pytest.approx(whole.chances, abs=1e-4)
    assert few.place == whole.place
    assert few.size.value == pytest.approx(whole.size.value, rel=1e-3)
