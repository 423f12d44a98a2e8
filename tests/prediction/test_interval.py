"""The interval against errors drawn from a known process, and the arithmetic that it rests on."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.prediction.error_band import RunError, calibrate, error_of

RATE_HZ = 25.0
TIME = np.arange(450) / RATE_HZ  # 18 s: a contact run of the rich protocol
FORCE = 1.2 - 1.2 * np.cos(2 * np.pi * TIME)
FORCE_RATE = 2 * np.pi * 1.2 * np.sin(2 * np.pi * TIME)


def drawn_run(
    rng: np.random.Generator, bias: float = 0.01, offset: float = 0.01, noise: float = 0.01
) -> RunError:
    """An error with a systematic part, an offset of the run, and noise that lasts about a quarter second.

    The noise is four times larger at the peak than at rest.
    """
    slow = np.zeros(len(TIME))
    for i in range(1, len(slow)):
        slow[i] = 0.85 * slow[i - 1] + np.sqrt(1 - 0.85**2) * rng.standard_normal()
    spread = noise * (0.25 + 0.75 * FORCE / FORCE.max())
    error = bias * np.sin(2 * np.pi * TIME) + offset * rng.standard_normal() + spread * slow
    return RunError(FORCE, FORCE_RATE, error)


@pytest.mark.parametrize("runs", [4, 10])
def test_nine_in_ten_samples_of_fresh_runs_lie_inside(runs: int) -> None:
    """Autocorrelated noise, a run's own offset and a systematic misfit, none of which is white."""
    rng = np.random.default_rng(20)
    shares = []
    for _ in range(60):
        band = calibrate([drawn_run(rng) for _ in range(runs)])
        assert band is not None
        fresh = drawn_run(rng)
        shares.append(np.mean(np.abs(fresh.error) <= band.half_width(fresh.force, fresh.rate)))
    assert 0.85 <= np.mean(shares) <= 0.95


def test_the_interval_is_wide_where_the_error_is() -> None:
    rng = np.random.default_rng(4)
    band = calibrate([drawn_run(rng, bias=0.0, offset=0.0) for _ in range(10)])
    assert band is not None
    peak, rest = (float(band.half_width(np.array([f]), np.array([0.0]))[0]) for f in (2.4, 0.0))
    # 90 % of a normal error lie within 1.645 standard deviations; noise 10 mN at the peak, 2.5 mN at rest.
    assert peak == pytest.approx(1.645 * 0.0100, rel=0.15)
    assert rest == pytest.approx(1.645 * 0.0028, rel=0.25)
    assert band.factor == pytest.approx(1.0, abs=0.1)


def test_beyond_the_calibrated_forces_the_interval_grows_with_the_force() -> None:
    rng = np.random.default_rng(5)
    band = calibrate([drawn_run(rng) for _ in range(4)])
    assert band is not None
    known, twice = (float(band.half_width(np.array([f]), np.array([0.0]))[0]) for f in (2.4, 3.6))
    assert twice == pytest.approx(2.0 * known, rel=1e-6)  # 1.2 N from the centre, then 2.4 N


def test_one_run_gives_no_interval() -> None:
    assert calibrate([drawn_run(np.random.default_rng(1))]) is None


def test_runs_weigh_the_same_however_long() -> None:
    short = RunError(FORCE[:50], FORCE_RATE[:50], np.full(50, 0.03))
    long = [RunError(FORCE, FORCE_RATE, np.full(450, 0.01))] * 2
    band = calibrate([short, *long])
    assert band is not None
    # A third of the weight lies at 30 mN: by samples it would be a twentieth and outside the 90 %.
    assert min(band.widths) >= 0.03


def test_samples_without_a_number_are_left_out() -> None:
    measured = FORCE.copy()
    measured[:100] = np.nan
    error = error_of(FORCE + 0.02, measured, RATE_HZ)
    assert error is not None
    assert len(error.error) == 350
    assert error.error == pytest.approx(np.full(350, 0.02))
    assert error_of(FORCE, np.full_like(FORCE, np.nan), RATE_HZ) is None
