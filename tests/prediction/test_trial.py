"""Force errors of a trial: known by construction, and on the simulated rig with an effect."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from click.testing import CliRunner

from fingerlab.acquisition.protocols.force_trial import Practice, best_practices, furthest_position_deg
from fingerlab.cli.main import cli
from fingerlab.core.errors import UserError
from fingerlab.models.file import load_model
from fingerlab.prediction.extended import extended_model
from fingerlab.prediction.feed_forward import first_plan, mean_plan
from fingerlab.prediction.inverse import TorquePlan, needed_torque
from fingerlab.prediction.target import pose_of_run, wanted_force
from fingerlab.prediction.trial import Trial, analyse_trial
from fingerlab.report.comparison_words import rest_sentence, share_sentence, trial_sentence
from fingerlab.rig.file import Motor, Rig
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Run, Session
from tests.prediction.trial_model import EFFECT, SEED, model_with_effect

RATE, LEAD, SECONDS = 1000.0, 2.0, 8.0


def wanted(time: np.ndarray) -> np.ndarray:
    return 1.0 + 0.5 * np.sin(np.pi * time)


def made(errors: list[tuple[str, Callable[[np.ndarray], np.ndarray]]]) -> Trial:
    """A session whose runs miss the wanted force by these errors."""
    time = np.arange(round((LEAD + SECONDS) * RATE)) / RATE
    points = [round(float(f), 6) for f in wanted(np.arange(0.0, SECONDS + 0.01, 0.02))]
    about = json.dumps({"lead_s": LEAD, "step_s": 0.02, "force_n": points})
    runs = tuple(
        Run.from_arrays(
            {"endpoint_force": wanted(time - LEAD) + error(time - LEAD)}, name=f"{k:03d}", phase="contact",
            cable="flexion", sample_rate_hz=RATE,
            attributes={"force_model": model, "wanted_force": about, "foretold_rms_n": 0.1},
        )
        for k, (model, error) in enumerate(errors, start=1)
    )  # fmt: skip
    told = {"force_trial": json.dumps({"model": "M.json", "effects": ["coulomb_friction"]})}
    rig = Rig(None, Motor(torque_constant=0.0302, gear_ratio=4.3, pulley_radius=0.015, inertia=None))
    return analyse_trial(Session(Path("made.h5"), "", "", rig, runs, told))


def constant(value: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda time: np.full_like(time, value)


def test_rms_peak_and_ratio_of_constant_errors() -> None:
    found = made([(m, constant(e)) for m, e in [("nominal", 0.1), ("found", 0.02), ("found", 0.04),
                                                ("nominal", 0.1)]])  # fmt: skip
    assert found.nominal is not None
    assert found.found is not None
    assert found.nominal.rms == pytest.approx(0.1, abs=2e-4)
    assert found.found.rms == pytest.approx(math.sqrt((0.02**2 + 0.04**2) / 2), abs=2e-4)
    assert found.found.peak == pytest.approx(0.03, abs=1e-3)
    # Two pairs: each drawn twice at the ends, so that the interval is that of the single pairs.
    assert (found.low, found.high) == (pytest.approx(0.2, abs=4e-3), pytest.approx(0.4, abs=4e-3))
    # Variance of 0.02 and 0.04 about 0.03 with one degree of freedom.
    assert found.found.repeatability == pytest.approx(0.01 * math.sqrt(2.0), rel=1e-2)
    assert trial_sentence(found).startswith("The force error fell from 100.0 mN to 31.6 mN, to 32 %")


@pytest.mark.parametrize(
    ("cause", "error"),
    [
        ("offset", constant(0.05)),
        ("gain", lambda time: 0.1 * (wanted(time) - 1.0)),
        ("delay", lambda time: wanted(time - 0.02) - wanted(time)),
        ("friction", lambda time: 0.05 * np.sign(np.cos(np.pi * time))),
        ("rest", lambda time: 0.05 * np.sin(7.0 * np.pi * time)),
    ],
)
def test_each_cause_is_told(cause: str, error: Callable[[np.ndarray], np.ndarray]) -> None:
    found = made([("nominal", constant(0.1)), ("found", error)]).found
    assert found is not None
    assert sum(found.parts.values()) == pytest.approx(1.0)
    assert max(found.parts, key=lambda name: found.parts[name]) == cause
    assert found.parts[cause] > 0.9


def test_what_differs_from_run_to_run_is_scatter() -> None:
    errors = [("found", lambda time, k=k: 0.05 * np.sin(9.0 * time + 2.1 * k)) for k in range(3)]
    found = made(errors).found
    assert found is not None
    assert found.parts["scatter"] > 0.95
    assert "differs from run to run" in rest_sentence(found)


@pytest.mark.parametrize(
    ("share", "words"),
    [(1.0, ""), (0.38, "Practice bore out 38 % of the way"), (0.0, "missed no less than the nominal one")],
)
def test_how_far_the_found_torque_was_sent_is_said(share: float, words: str) -> None:
    trial = made([("nominal", constant(0.1)), ("found", constant(0.02))])
    assert trial.found_share == 1.0  # of an earlier version, which went all the way
    said = share_sentence(replace(trial, found_share=share))
    assert words in said
    assert bool(said) == bool(words)


def test_a_session_that_is_no_trial_is_one_sentence() -> None:
    rig = Rig(None, Motor(torque_constant=0.0302, gear_ratio=4.3, pulley_radius=0.015, inertia=None))
    with pytest.raises(UserError, match="holds no feed-forward trial"):
        analyse_trial(Session(Path("plain.h5"), "", "", rig, (), {}))


def test_what_is_sent_is_the_mean_of_the_practices_that_missed_least() -> None:
    """A tip that slid at another moment spoils one practice; a constant is trimmed and does not count."""
    time = np.arange(2000) / 250.0
    run = Run.from_arrays({"endpoint_force": wanted(time)}, name="1", phase="contact", cable="flexion")
    wave = math.sqrt(2.0) * np.sin(np.pi * time)
    sent = Mock(TorquePlan)
    practices = [Practice(run, 0.0, rms * wave + constant, sent) for rms, constant in
                 [(0.0061, 0.0), (0.005, 0.2), (0.0064, 0.0), (0.009, 0.0)]]  # fmt: skip
    assert best_practices(practices) == practices[:2]
    assert best_practices(practices)[1].missed == pytest.approx(0.005, rel=1e-3)


BENCH = ("--effect", EFFECT, "--seed", str(SEED))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return model_with_effect(tmp_path_factory.mktemp("trial"))


@pytest.fixture(autouse=True)
def _short_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fingerlab.acquisition.protocols.force_trial.POSE_S", 4.0)
    monkeypatch.setattr("fingerlab.acquisition.protocols.force_trial.PRACTICES", 2)


def record(model: Path, out: Path, wish: dict[str, object], *more: str) -> object:
    return CliRunner().invoke(
        cli,
        ["record", "--feed-forward", str(model), "--wanted", json.dumps(wish), "--device", "simulated",
         "--rest", "0.1", "--out", str(out), *BENCH, *more],
    )  # fmt: skip


WISH = {"kind": "sine", "mean_n": 0.9, "amplitude_n": 0.4, "frequency_hz": 0.5, "duration_s": 3.0}


def test_on_the_simulated_rig_the_error_falls(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "T.h5"
    done = record(model, out, WISH, "--ab", "1")
    assert done.exit_code == 0, done.exception  # type: ignore[attr-defined]
    session = open_session(out)
    sent = [run.attributes["force_model"] for run in session.runs]
    assert sent[:2] == ["pose", "practice"]
    assert sent[2:6] == 2 * ["practice nominal", "practice found"]
    assert sorted(sent[6:]) == ["found", "nominal"]
    assert json.loads(session.runs[-1].attributes["wanted_force"])["force_n"][0] == pytest.approx(0.9)
    shown = CliRunner().invoke(cli, ["trial", str(out), "--json", "-"])
    told = json.loads(shown.stdout)
    assert told["ratio"]["value"] < 0.5
    assert told["found"]["rms"] < 0.02  # N; the load cell's noise, low-passed, is 2 mN
    assert told["ratio"]["interval"]["low"] is None

    _first_torque_is_the_lesser(model, session)


def _first_torque_is_the_lesser(model: Path, session: Session) -> None:
    """A nominal model that asks for a multiple presses too hard; one that asks for less shows the contact."""
    pair = extended_model(load_model(model), "M.json")
    pose, wish = pose_of_run(session.runs[0]), wanted_force(json.dumps(WISH))

    def most(plan: TorquePlan) -> float:
        return float(plan.torque.max())

    nominal, found = (
        most(needed_torque(wish, one, pose, session.rig, "M.json")) for one in (pair.nominal, pair.extended)
    )
    assert abs(found / nominal - 1.0) > 0.02
    plan = needed_torque(wish, pair.extended, pose, session.rig, "M.json")
    half = mean_plan([plan, replace(plan, torque=0.5 * plan.torque)], session.rig)
    assert half.torque == pytest.approx(0.75 * plan.torque)
    for both in (pair, replace(pair, nominal=pair.extended, extended=pair.nominal)):
        assert most(first_plan(wish, both, pose, session.rig, "M.json")) == pytest.approx(min(nominal, found))


@pytest.mark.parametrize(("compliance", "torque", "degrees"), [
    (0.0, 0.3, 35.0),  # 20 degrees reached, and 15 more
    (1e-4, 0.3, 35.0 + math.degrees(1e-4 * 0.2 / 0.015**2)),  # a cable gives C T / r^2 radians
    (1e-4, 0.05, 35.0),  # less torque than before
    (1e-4, 50.0, 160.0),  # the rig's limit
])  # fmt: skip
def test_the_pulley_may_go_as_much_further_as_the_found_cable_gives(
    compliance: float, torque: float, degrees: float
) -> None:
    motor = Motor(torque_constant=0.0302, gear_ratio=4.3, pulley_radius=0.015, inertia=None)
    told = furthest_position_deg(math.radians(20.0), 0.1, torque, compliance, Rig(None, motor))
    assert told == pytest.approx(degrees)


def test_it_ends_where_the_force_is_beyond_what_was_allowed(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bound below the wanted force stands for a finger that presses far harder than it should."""
    monkeypatch.setattr("fingerlab.acquisition.protocols.force_trial.HARDER", 0.1)
    out = tmp_path / "T.h5"
    done = record(model, out, WISH, "--ab", "1")
    assert "stay below" in str(done.exception)  # type: ignore[attr-defined]
    session = open_session(out)
    assert [run.attributes["force_model"] for run in session.runs] == ["pose", "practice"]
    force = session.runs[1].channel("endpoint_force")
    assert force.max() < 1.0  # N, knock and noise included: the wanted force goes on to 1.3 N


def test_stopped_in_the_middle_the_motor_has_no_current_and_the_recording_is_read(
    model: Path, tmp_path: Path
) -> None:
    orders, out = tmp_path / "orders.txt", tmp_path / "T.h5"
    orders.write_text("@3:3.0 stop\n", encoding="utf-8")
    done = record(model, out, WISH, "--ab", "1", "--commands", str(orders))
    assert done.exit_code != 0  # type: ignore[attr-defined]
    session = open_session(out)
    assert [run.attributes["force_model"] for run in session.runs] == ["pose", "practice", "practice nominal"]
    last = session.runs[-1]
    assert 3.0 <= last.seconds < 3.2
    torque = last.channel("motor_torque")
    assert torque[2900] > 0.05  # N m: it pressed when it was stopped
    assert abs(torque[-1]) < 0.02  # within the millisecond; the current sensor's noise is 0.003
    with pytest.raises(UserError, match="broke off while it practised"):
        analyse_trial(session)


@pytest.mark.parametrize(
    ("wish", "more", "words"),
    [
        ({**WISH, "duration_s": 30.0}, (), "takes up to 20 s"),
        ({**WISH, "mean_n": 11.0}, (), "the rig's limit is 10 N"),
        (WISH, ("--phase", "contact"), "leave out --phase"),
        (WISH, ("--ab", "2", "--runs", "3"), "leave out --runs"),
    ],
)
def test_what_cannot_be_sent_is_one_sentence(
    model: Path, tmp_path: Path, wish: dict[str, object], more: tuple[str, ...], words: str
) -> None:
    done = record(model, tmp_path / "T.h5", wish, *more)
    assert words in str(done.exception)  # type: ignore[attr-defined]
    assert not (tmp_path / "T.h5").exists()
