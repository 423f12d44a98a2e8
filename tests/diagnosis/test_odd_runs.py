"""Runs that contradict the others: each fault is made in one run of a bench that is sound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.odd_runs import odd_runs
from fingerlab.sessions.model import Array, Run, Session

from . import closed_form as made

FREE, PRESSED = "001", "009"
"""A run on air and one in contact."""
Channels = dict[str, Array]


@pytest.fixture(scope="module")
def sound() -> Session:
    return made.session(made.Bench(), 3)


def spoiled(session: Session, name: str, change: Callable[[Channels], Channels], **told: str) -> Session:
    """The session with one run's channels changed, or what is told of it."""
    runs = []
    for run in session.runs:
        if run.name != name:
            runs.append(run)
            continue
        channels = change(dict(run.load(list(run.units), 0, run.length)))
        about = {"phase": run.phase, "cable": run.cable, "sample_rate_hz": run.sample_rate_hz, **told}
        again = Run.from_arrays(channels, name=run.name, **about)
        runs.append(replace(again, trajectory=run.trajectory))
    return replace(session, runs=tuple(runs))


def found(session: Session) -> list[tuple[str, str, str]]:
    each = odd_runs((session, run) for run in session.runs)
    return [(one.run, one.why, one.channel) for one in each.values()]


def _set(channel: str, law: Callable[[Array], Array]) -> Callable[[Channels], Channels]:
    return lambda channels: {**channels, channel: law(channels[channel])}


def _noise(values: Array) -> Array:
    return 0.05 * np.random.default_rng(1).standard_normal(len(values))


def test_runs_of_a_sound_bench_agree(sound: Session) -> None:
    assert found(sound) == []


@pytest.mark.parametrize(
    "missing", [made.Missing(compliance=5e-4), made.Missing(delay=0.02), made.Missing(tilt=0.3)]
)
def test_what_an_effect_does_is_no_fault_of_a_run(missing: made.Missing) -> None:
    assert found(made.session(made.Bench(missing=missing), 3)) == []


@pytest.mark.parametrize(
    ("name", "channel", "law", "why"),
    [
        (FREE, "pip_angle", lambda values: np.full_like(values, 0.1), "still"),
        (FREE, "mcp_angle", _noise, "noise"),
        (FREE, "pip_angle", np.negative, "turned"),
        (PRESSED, "endpoint_force", lambda values: 0.01 * values, "still"),
        (PRESSED, "endpoint_force", lambda values: np.minimum(values, np.quantile(values, 0.8)), "clipped"),
    ],
)  # fmt: skip
def test_a_run_with_a_fault_is_told_with_its_channel(
    sound: Session, name: str, channel: str, law: Callable[[Array], Array], why: str
) -> None:
    assert found(spoiled(sound, name, _set(channel, law))) == [(name, why, channel)]


def test_a_run_under_the_other_cable_s_name_turns_against_it(sound: Session) -> None:
    run = next(one for one in sound.runs if one.name == FREE)
    other = "flexion" if run.cable == "extension" else "extension"
    assert (FREE, "turned", "motor_position") in found(spoiled(sound, FREE, dict, cable=other))


def test_a_run_that_no_model_of_the_others_explains_costs_that_run_alone(sound: Session) -> None:
    """Its current was read in another range, by half as much again: no channel of it contradicts another."""
    told = diagnose(
        [spoiled(sound, FREE, _set("motor_torque", lambda values: 1.5 * values))], with_curves=False
    )
    assert told.verdict == "nothing_missing"
    assert [(one.kind, one.runs) for one in told.bench] == [("odd_run", (FREE,))]
    assert told.score < 1.2


def test_what_is_left_aside_is_said_with_what_to_do(sound: Session) -> None:
    turned = spoiled(sound, FREE, _set("pip_angle", np.negative))
    told = diagnose([turned], with_curves=False)
    assert told.verdict == "nothing_missing"
    assert told.bench[0].to_json()["finding"] == "sense"
    assert told.bench[0].text == (
        f"Channel 'pip_angle' is turned round in run {FREE}, other than in the others; it is left aside: "
        "turn its sign."
    )
