"""Moment arms, losses and delays of invented sessions with a closed form, and of foreign recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import Cancelled, UserError
from fingerlab.sessions import open_session
from fingerlab.thesis.fitting import fit_session
from fingerlab.thesis.traces import FitSpec

from . import invented as made

TRUE = {"mcp": (made.A, made.L_MCP), "pip": (made.B, made.L_PIP)}


def _runs(delay: int = 0, count: int = 3, sign: int = -1):
    cable = "extension" if sign < 0 else "flexion"
    return [
        made.run(f"{i:03d}", made.on_air(made.sine_tension(phase=0.3 * i), sign, delay), cable=cable)
        for i in range(1, count + 1)
    ]


@pytest.mark.parametrize("method", ["regions", "flexion-extension", "whole"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_known_arms_and_losses_come_back(method, sign: int) -> None:
    fit = fit_session(made.session(*_runs(sign=sign)), FitSpec(method))
    (results,) = fit.cables.values()
    assert fit.skipped == ()
    for (joint, region), result in results.items():
        arm, loss = TRUE[joint]
        assert result.pooled is not None, region
        assert result.pooled.moment_arm.value == pytest.approx(arm, rel=1e-3)
        assert result.pooled.loss.value == pytest.approx(loss, abs=3e-5)
        assert result.pooled.r2 > 0.999
        assert result.pooled.moment_arm.unit == "m"
        assert result.pooled.loss.unit == "N m"


@pytest.mark.parametrize("delay", ["xcorr", "findsignal"])
def test_a_delay_that_was_put_in_is_found_and_taken_out(delay) -> None:
    session = made.session(*_runs(delay=162))
    bare = fit_session(session, FitSpec("flexion-extension", "none", 20)).cables["extension"]
    fit = fit_session(session, FitSpec("flexion-extension", delay, 20)).cables["extension"]
    for key, result in fit.items():
        assert result.pooled is not None
        assert result.delays_s.values == pytest.approx((0.162,) * 3, abs=1e-9)
        assert result.pooled.moment_arm.value == pytest.approx(TRUE[key[0]][0], rel=1e-3)
        assert result.pooled.r2 > 0.9999 > bare[key].r2.mean


def test_delay_of_a_run_that_does_not_repeat() -> None:
    t = np.arange(20000) / made.RATE
    chirp = 3 + 2 * np.sin(2 * np.pi * (0.3 * t + 0.05 * t**2))
    run = made.run("001", made.on_air(chirp, delay=40), kind="chirp")
    fit = fit_session(made.session(run), FitSpec("whole", "xcorr"))
    result = fit.cables["extension"]["pip", "whole"]
    assert result.delays_s.values == pytest.approx((0.040,), abs=0.0015)


def test_pooled_line_is_the_line_through_the_concatenated_samples() -> None:
    random = np.random.default_rng(6)
    runs = []
    for i in range(4):
        tension = made.sine_tension(phase=0.4 * i) * (1 + 0.2 * i)
        noise = 0.002 * np.sin(2 * np.pi * 1.7 * np.arange(len(tension)) / 1000 + random.uniform(0, 6))
        runs.append(made.run(f"{i}", made.on_air(tension, noise=noise)))
    fit = fit_session(made.session(*runs), FitSpec("whole")).cables["extension"]["pip", "whole"]
    from fingerlab.thesis.traces import trace

    x, y = [], []
    for run in runs:
        traces = trace(run, made.RIG)
        x.append(traces.tension[2000:19000])
        y.append(traces.lhs["pip"][2000:19000])
    slope, intercept = np.polyfit(np.concatenate(x), np.concatenate(y), 1)
    assert fit.pooled is not None
    assert -fit.pooled.moment_arm.value == pytest.approx(slope, rel=1e-9)
    assert fit.pooled.loss.value == pytest.approx(intercept, rel=1e-9)
    assert fit.pooled.samples == 4 * 17000


def test_chirps_are_left_to_whole_and_named() -> None:
    t = np.arange(20000) / made.RATE
    chirp = 3 + 2 * np.sin(2 * np.pi * (0.3 * t + 0.05 * t**2))
    session = made.session(*_runs(count=2), made.run("009", made.on_air(chirp), kind="chirp"))
    fit = fit_session(session, FitSpec("regions"))
    assert fit.used == {"extension": ("001", "002")}
    assert [name for name, _ in fit.skipped] == ["009"]
    assert fit_session(session, FitSpec("whole")).used == {"extension": ("001", "002", "009")}


def test_each_cable_has_its_own_parameters() -> None:
    flexion = made.on_air(made.sine_tension(), sign=1)
    session = made.session(*_runs(), made.run("004", flexion, cable="flexion"))
    fit = fit_session(session, FitSpec("whole"))
    assert set(fit.cables) == {"extension", "flexion"}
    assert fit.used["flexion"] == ("004",)


def test_a_region_that_is_missing_is_missing() -> None:
    """Slow flexion and a snap back: at 30 % no flexion, the rest is fitted."""
    t = np.arange(20000) / made.RATE
    saw = np.where(t % 1.0 < 0.85, (t % 1.0) / 0.85, (1.0 - t % 1.0) / 0.15)
    run = made.run("001", made.on_air(5 - 4 * saw))
    fit = fit_session(made.session(run), FitSpec("flexion-extension", "none", 30)).cables["extension"]
    assert fit["pip", "flexion"].pooled is None
    assert np.isnan(fit["pip", "flexion"].r2.values[0])
    assert fit["pip", "extension"].pooled is not None


@pytest.mark.parametrize(
    ("runs", "spec", "words"),
    [
        ([("contact", "flexion")], FitSpec(), "no run on air"),
        ([("on_air", "none")], FitSpec(), "no run on air"),
        ([("on_air", "extension")], FitSpec("whole", "findsignal"), "belongs to a region"),
    ],
)
def test_what_cannot_be_fitted_is_one_sentence(runs, spec, words) -> None:
    made_runs = [made.run("001", made.on_air(made.sine_tension()), phase, cable) for phase, cable in runs]
    with pytest.raises(UserError, match=words):
        fit_session(made.session(*made_runs), spec)


@pytest.mark.parametrize("frequency", [None, 0.0, -1.0, float("nan"), "1 Hz", 1.3])
def test_a_trajectory_that_names_no_true_period(frequency) -> None:
    run = made.run("001", made.on_air(made.sine_tension()), frequency=frequency)
    with pytest.raises(UserError, match="does not repeat"):
        fit_session(made.session(run), FitSpec())
    assert fit_session(made.session(run), FitSpec("whole")).used == {"extension": ("001",)}


def test_too_short_a_run_is_told() -> None:
    run = made.run("001", made.on_air(made.sine_tension(2.2)))
    with pytest.raises(UserError, match="No on-air run"):
        fit_session(made.session(run), FitSpec("whole"))


def test_progress_and_cancel() -> None:
    seen: list[float] = []
    fit_session(made.session(*_runs()), FitSpec(), lambda share, what: seen.append(share))
    assert seen == pytest.approx([0, 1 / 3, 2 / 3])

    def stop(share: float, what: str) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        fit_session(made.session(*_runs()), FitSpec(), stop)


def test_foreign_recording_without_a_missing_effect(shared_data: Path) -> None:
    """bench-plain: nothing is missing, so motion regions agree with one another and with a straight line."""
    session = open_session(shared_data / "bench-plain.h5")
    fit = fit_session(session, FitSpec())
    for results in fit.cables.values():
        for joint in ("mcp", "pip"):
            up, down = results[joint, "flexion"].pooled, results[joint, "extension"].pooled
            assert up is not None
            assert down is not None
            assert up.r2 > 0.999
            assert down.r2 > 0.999
            assert up.moment_arm.value == pytest.approx(down.moment_arm.value, rel=0.01)
    assert fit.used["extension"] == ("001", "002", "003")


def test_foreign_recording_with_a_delay(shared_data: Path) -> None:
    """bench-delay: the joint angles come later, on every run and by either method; bench-plain: not."""
    spec = FitSpec("flexion-extension", "xcorr", 20)
    late = fit_session(open_session(shared_data / "bench-delay.h5"), spec).cables["extension"]
    plain = fit_session(open_session(shared_data / "bench-plain.h5"), spec).cables["extension"]
    assert max(abs(v) for v in plain["pip", "flexion"].delays_s.values) <= 0.0021
    values = late["pip", "flexion"].delays_s.values
    assert min(values) > 0.003
    assert max(values) - min(values) <= 0.004


def test_long_runs_are_cut_into_pieces_that_start_with_a_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same parameters in pieces, no sample lost or doubled, and never more than a piece in memory."""
    from fingerlab.thesis import fitting

    monkeypatch.setattr(fitting, "LARGEST_PIECE", 15000)
    tension = made.sine_tension(50.0)
    whole = made.run("001", {**made.on_air(tension), "counter": np.arange(50000.0)})
    parts = fitting.in_pieces([whole])
    assert [p.name for p in parts] == ["001:1", "001:2", "001:3", "001:4"]
    counters = [p.channel("counter") for p in parts]
    np.testing.assert_array_equal(np.concatenate(counters), np.arange(50000.0))
    assert all(c[0] % 1000 == 0 for c in counters)
    assert max(map(len, counters)) <= 15000
    np.testing.assert_array_equal(parts[1].channel("counter", 5, 8), counters[1][5:8])
    fit = fit_session(made.session(whole), FitSpec()).cables["extension"]["pip", "flexion"]
    assert fit.pooled is not None
    assert fit.pooled.moment_arm.value == pytest.approx(made.B, rel=1e-3)
    assert fit.runs == ("001:1", "001:2", "001:3", "001:4")
