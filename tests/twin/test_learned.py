"""A twin of a verdict: the loop closes, values are drawn as told, and what no twin has is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from math import hypot, radians
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fingerlab.cli.diagnose import diagnose
from fingerlab.cli.simulate import reveal, simulate
from fingerlab.core.errors import UserError
from fingerlab.core.text import ParameterEstimate
from fingerlab.devices.simulated import SimulatedBench, Simulation
from fingerlab.effects import CATALOGUE
from fingerlab.models.file import DIAGNOSIS_METHOD, SavedModel, load_model, save_model
from fingerlab.prediction import fit_extended, model_of_extended
from fingerlab.rig.file import default_rig
from fingerlab.sessions import open_session
from fingerlab.twin.bench import learned, preset_of
from fingerlab.twin.effects import EFFECTS
from fingerlab.twin.plant import Nominal
from fingerlab.twin.protocols import load_preset

RUNS = """phase,cable,kind,amplitude_deg,offset_deg,frequency_hz,duration_s,runs
on_air,extension,sine,14,22,1,6,2
on_air,extension,sine,14,22,0.5,6,1
on_air,flexion,sine,14,22,0.7,6,1
"""
FRICTION = {"viscous_mcp": 2.5e-3, "viscous_pip": 1.5e-3}


def called(command: object, *arguments: object) -> str:
    result = CliRunner().invoke(command, [str(one) for one in arguments])  # type: ignore[arg-type]
    assert result.exit_code == 0, result.output
    return result.output


def test_a_twin_of_the_verdict_has_the_verdict(tmp_path: Path) -> None:
    """Simulate, fit, simulate the model, diagnose: the same effect, its values within the intervals."""
    table, model, again = tmp_path / "runs.csv", tmp_path / "model.json", tmp_path / "again.json"
    table.write_text(RUNS, encoding="utf-8")
    first, twin = tmp_path / "first.h5", tmp_path / "twin.h5"
    called(simulate, "--protocol", table, "--effect", "viscous_friction", "--seed", 31, "--out", first)
    # As 'diagnose --save' does; that the search finds it is told of the twin below.
    save_model(model_of_extended(fit_extended([open_session(first)], ["viscous_friction"])), model)
    found = load_model(model)
    called(
        simulate, "--protocol", table, "--model", model, "--best-values", "--seed", 77, "--out", twin,
        "--json", tmp_path / "told.json",
    )  # fmt: skip
    told = json.loads((tmp_path / "told.json").read_text(encoding="utf-8"))["effects"]["viscous_friction"]
    assert told["mcp"] == pytest.approx(found.parameters["viscous_friction.viscous_mcp"].value)
    assert f"mcp = {told['mcp']:.4g}" in called(reveal, twin)
    called(diagnose, twin, "--json", again)
    second = json.loads(again.read_text(encoding="utf-8"))
    assert second["final_model"] == ["viscous_friction"]
    for name, value in second["candidates"][0]["parameters"].items():
        before = found.parameters[f"viscous_friction.{name}"]
        half = hypot(0.5 * (before.high - before.low), 0.5 * (value["high"] - value["low"]))
        assert abs(value["value"] - before.value) < 1.3 * half


def written(path: Path, effects: dict[str, dict[str, float]], **bench: tuple[float, float]) -> Path:
    """A model's file: effects with a value each and a tenth of it either way, bench values with theirs."""
    parameters = {
        f"{name}.{key}": ParameterEstimate(value, "1", 0.9 * value, 1.1 * value)
        for name, values in effects.items()
        for key, value in values.items()
    }
    parameters |= {
        key.replace("_at_", "@"): ParameterEstimate(value, "1", value - half, value + half)
        for key, (value, half) in bench.items()
    }
    shapes = {name: {"travel_deg": 0.4, "sharpness": 1.0} for name in effects if "coulomb" in name}
    save_model(SavedModel(DIAGNOSIS_METHOD, parameters, (), tuple(effects), {"shapes": shapes}), path)
    return path


def test_values_are_drawn_from_their_intervals(tmp_path: Path) -> None:
    path = written(
        tmp_path / "m.json", {"viscous_friction": FRICTION},
        arm_mcp_at_flexion=(0.011, 0.0002), arm_pip_at_flexion=(0.006, 0.0001), torque_gain=(0.03, 0.01),
    )  # fmt: skip
    bench = load_preset()
    best = learned(path, bench, 3, best=True)
    assert best.effects["viscous_friction"] == {"mcp": 2.5e-3, "pip_ratio": pytest.approx(0.6)}
    assert best.preset.numbers["arms"]["flexion"] == (0.011, 0.006)
    assert best.preset.numbers["arms"]["extension"] == bench.numbers["arms"]["extension"]
    assert best.preset.known["torque_constant"] == pytest.approx(0.97)
    assert learned(path, bench, 3).values == learned(path, bench, 3).values
    drawn = np.array([learned(path, bench, seed).effects["viscous_friction"]["mcp"] for seed in range(200)])
    # A tenth is 1.645 standard deviations; a normal clipped at 2 has 0.96 of its deviation.
    assert drawn.std() == pytest.approx(0.96 * 0.1 * 2.5e-3 / 1.645, rel=0.12)
    assert drawn.mean() == pytest.approx(2.5e-3, rel=0.02)


def test_the_simulated_rig_takes_a_model(tmp_path: Path) -> None:
    """A way behind a reversal of 0.4 degrees is one of 0.2 degrees from nothing."""
    path = written(tmp_path / "m.json", {"motor_coulomb_friction": {"coulomb": 6e-3}})
    bench = SimulatedBench(Simulation(str(path), seed=5), default_rig().daq)
    assert bench.preset.name == "m.json"
    law = bench.preset.effects["motor_coulomb_friction"]
    assert law["travel"] == pytest.approx(radians(0.2))
    assert law["torque"] == preset_of(path, 5).effects["motor_coulomb_friction"]["torque"]
    assert abs(law["torque"] / 6e-3 - 1.0) < 0.13
    assert law["torque"] != preset_of(path, 6).effects["motor_coulomb_friction"]["torque"]


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.found is not None])
def test_a_twin_reads_the_names_that_the_effect_has(name: str) -> None:
    """The two files of an effect do not import each other; what one finds, the other understands."""
    effect, twin = CATALOGUE[name], EFFECTS[name]
    assert twin.found is not None
    values = {key: gain.typical for key, gain in effect.unknowns.items()}
    shape = dict(effect.shapes[0]) | ({"edge_deg": -16.0, "hertz": 1.0} if name == "joint_stop" else {})
    values |= {"growth_mcp": 0.0, "growth_pip": 0.0, "rate_pip": 0.0}
    told = twin.found({**values, **shape}, Nominal((0.1, 0.05), 2.5e-5, 3e-5))
    assert set(told) <= {parameter.name for parameter in twin.parameters} | {"sign", "phase"}
    assert all(np.isfinite(list(told.values())))


def test_what_no_twin_has_is_refused(tmp_path: Path) -> None:
    slack = written(tmp_path / "slack.json", {"cable_slack": {}})
    with pytest.raises(UserError, match="holds the effect 'cable_slack', which no twin can be given"):
        learned(slack, load_preset(), 1)
    thesis = tmp_path / "thesis.json"
    save_model(replace(load_model(slack), method="regions"), thesis)
    with pytest.raises(UserError, match="of the method 'regions', which tells too little for a bench"):
        learned(thesis, load_preset(), 1)
    out = ["--protocol", "thesis", "--out", str(tmp_path / "s.h5")]
    alone = CliRunner().invoke(simulate, [*out, "--best-values"])
    assert isinstance(alone.exception, UserError)
    twice = written(tmp_path / "m.json", {"viscous_friction": FRICTION})
    both = CliRunner().invoke(simulate, [*out, "--model", str(twice), "--effect", "viscous_friction"])
    assert "leave out --effect viscous_friction" in str(both.exception)
