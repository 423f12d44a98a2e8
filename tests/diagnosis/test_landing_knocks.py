"""A tip that lands knocks on the load cell for a sample or two: how hard, such a reading tells only about.

The recordings are closed forms in which the force comes down to nothing once a second; knocks are added to
what the load cell reads, and none of them ever pushed the finger.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.filters import knocks_of, landing_samples, without_spikes
from fingerlab.sessions.model import Array, Run, Session

from . import closed_form as made

KNOCK_N, SAMPLES = 3.0, 2
AROUND = landing_samples(made.RATE)


def landings(seconds: float) -> Array:
    """Samples 60 ms after the force of a contact run was nothing, at 1 Hz."""
    at_nothing = (1.5 * np.pi - 0.4) / (2 * np.pi)
    return np.rint((np.arange(seconds - 1) + at_nothing + 0.06) * made.RATE).astype(int)


def knocking(run: Run, knock: float) -> Run:
    channels = run.load()
    for k in range(SAMPLES):
        channels["endpoint_force"][landings(run.seconds) + k] += knock
    return Run.from_arrays(
        channels, name=run.name, phase=run.phase, cable=run.cable, sample_rate_hz=run.sample_rate_hz,
        trajectory=run.trajectory,
    )  # fmt: skip


def session(knock: float, **missing: float) -> Session:
    bench = made.Bench(missing=made.Missing(**missing))  # type: ignore[arg-type]
    free = made.session(bench, contact=0)
    rng = np.random.default_rng(7)
    pressing = [
        knocking(made.contact_run(bench, 0.6, 0.6, 1.0, rng, 10.0, f"{9 + k:03d}"), knock) for k in range(3)
    ]
    return replace(free, runs=(*free.runs, *pressing))


def test_a_knock_is_what_it_adds_to_the_force_however_lightly_the_tip_presses_then() -> None:
    """60 ms after nothing the force is 42 mN of 1.2 N."""
    force = session(KNOCK_N).runs[-1].channel("endpoint_force")
    clean = session(0.0).runs[-1].channel("endpoint_force")
    kept, spikes = without_spikes(force, AROUND)
    assert len(spikes) == 0
    assert kept is force
    knocks = knocks_of(force, AROUND)
    assert np.flatnonzero(knocks).tolist() == sorted({*landings(10.0), *(landings(10.0) + 1)})
    assert np.abs(knocks - (force - clean)).max() < 0.03  # N; the noise is 4 mN
    assert not knocks_of(clean, AROUND).any()


def test_knocks_that_never_pushed_are_told_as_such_and_pass_for_no_effect() -> None:
    """Taken as they are read they leave eight floors, and pass for friction of the joints."""
    found = diagnose([session(KNOCK_N)], with_curves=False)
    assert found.verdict == "nothing_missing"
    assert found.score < 1.1
    assert found.fitted is not None
    assert found.fitted.values["knock_gain"] == pytest.approx(-1.0, abs=0.05)
    (told,) = [one for one in found.bench if one.kind == "knock"]
    assert told.size == pytest.approx(0.0, abs=0.05)
    assert "knocks on the load cell for a sample or two" in told.text


def test_where_nothing_knocks_nothing_is_said_of_it() -> None:
    found = diagnose([session(0.0)], with_curves=False)
    assert found.fitted is not None
    assert "knock_gain" not in found.fitted.values
    assert not [one for one in found.bench if one.kind == "knock"]


def test_an_effect_is_found_beside_them() -> None:
    found = diagnose([session(KNOCK_N, motor_viscous=6e-3)], with_curves=False)
    assert found.candidates[0].effect == "motor_viscous_friction"
    assert found.candidates[0].probability > 0.85
    assert found.path[-1].score < 1.1


@pytest.mark.parametrize(("coulomb", "verdict"), [(3.5e-5, "nothing_missing"), (6e-5, "missing_effect")])
def test_a_trace_of_friction_is_missing_only_where_a_model_without_it_is_far_off(
    coulomb: float, verdict: str
) -> None:
    """Sensors ten times as fine as usual; N m, of which 5e-3 are typical: of seven in a thousand the error
    is 1.3 floors, of twelve 1.7."""
    bench = made.Bench(
        missing=made.Missing(motor_coulomb=coulomb),
        angle_noise=2e-5,
        torque_noise=4e-5,
        position_noise=2e-6,
        force_noise=4e-4,
    )
    found = diagnose([made.session(bench)], with_curves=False)
    assert found.verdict == verdict
    told = next(one for one in found.candidates if one.effect == "motor_coulomb_friction")
    assert found.score**2 - told.score**2 > 0.3  # either way it is seen
