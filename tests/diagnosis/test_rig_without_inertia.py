"""A rig file that gives no inertia of the rotor, as the thesis' bench: nothing is subtracted for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.diagnosis.search.grid_refinement import fit_refined
from fingerlab.effects import CATALOGUE
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Session
from fingerlab.twin.protocols import load_preset
from fingerlab.twin.session import write_session

from . import closed_form as made
from .test_no_alarm import shortened


def without_inertia(session: Session) -> Session:
    return replace(session, rig=replace(session.rig, motor=replace(session.rig.motor, inertia=None)))


def test_a_cable_that_hangs_loose_now_and_then_is_seen_to(shared_data: Path) -> None:
    """What the rotor takes hides that this cable pulls no more in a fast multisine; the score was 3.9."""
    answer = diagnose([without_inertia(open_session(shared_data / "bench-coulomb.h5"))], with_curves=False)
    assert set(answer.final_model) == {"coulomb_friction", "motor_inertia"}
    assert answer.path[-1].score < 1.3


@pytest.mark.parametrize("hidden", [("spring_hardening",)])
def test_the_rotor_is_missing_beside_what_else_is(tmp_path: Path, hidden: tuple[str, ...]) -> None:
    path = tmp_path / "bench.h5"
    preset = load_preset()
    write_session(path, preset, "rich", shortened(20.0), {name: {} for name in hidden}, 104)
    answer = diagnose([without_inertia(open_session(path))], with_curves=False)
    assert set(answer.final_model) == {*hidden, "motor_inertia"}
    assert answer.path[-1].score < 1.3
    found = answer.final_parameters["motor_inertia.inertia"]
    assert preset.rig.motor.inertia is not None
    tolerance = preset.rig.tolerance_of("inertia")
    # The bench's own rotor differs from the rig file's by its tolerance; at most three of it, here.
    assert found.value == pytest.approx(preset.rig.motor.inertia, rel=3 * tolerance)


def test_a_stretch_lags_behind_the_tension_that_the_rotor_leaves() -> None:
    """A cable that gives 1 mm a newton 6 ms late, angles that are 10 ms late, a rotor that nobody weighed.

    With the lag of the torque in place of what the rotor leaves of it, the delay was 7.6 ms.
    """
    bench = made.Bench(missing=made.Missing(compliance=1e-3, lag=0.006, delay=0.010))
    kept = Reduction([without_inertia(made.session(bench, contact=0))])
    names = ("motor_inertia", "cable_stretch", "transport_delay")
    scorer, fitted = fit_refined(kept, [CATALOGUE[name] for name in names])
    scales = scorer.reduced.layout.scales
    values, stretch = dict(fitted.values), fitted.choices[1]
    assert values["delay"] * scales.of("s") == pytest.approx(0.010, abs=2e-4)
    late = stretch.effect.shapes[stretch.shape]["time_constant"]
    late -= values["cable_damping"] / values["cable_compliance"]
    assert late * scales.of("s") == pytest.approx(0.006, abs=1e-3)
    inertia = (values["motor_inertia.inertia"] + values["rotor_inertia"]) * scales.of("kg m^2")
    assert inertia == pytest.approx(made.INERTIA, rel=0.05)  # known to the torque constant's tolerance
