"""Sensors that lie: one try of each kind; ``python -m tests.faults.sensors`` counts them all."""

from __future__ import annotations

import pytest

from tests.faults.sensors import LIES, try_once

FEW = {
    ("wire off: 0 V", "load cell"): (2, "refused", "gives 0.0"),
    ("wire off: 0 V", "current monitor"): (3, "stopped", "were asked for"),
    ("noise only", "MCP sensor"): (3, "stopped", "no more than noise"),
    ("noise only", "load cell"): (20, "stopped", "at a fingertip that is held"),
    ("both wires off", "encoder"): (2, "stopped", "encoder stood still"),
    ("wrong sense", "encoder"): (2, "stopped", "against the current"),
    ("wrong sense", "PIP sensor"): (2, "stopped", "against the cable's pull"),
    ("cables swapped", "load cell and MCP sensor"): (2, "refused", "which sensor is on which terminal"),
    ("slack of 40° to 90°", "cable"): (2, "stopped", "does not follow the motor"),
}


@pytest.mark.parametrize("name", FEW, ids=" ".join)
def test_a_sensor_that_lies_is_refused_or_stopped_with_its_sentence(name: tuple[str, str]) -> None:
    seed, how, words = FEW[name]
    lie = next(lie for lie in LIES if (lie.name, lie.sensor) == name)
    seen = try_once(lie, seed)
    assert seen.how == how
    assert words in seen.sentence
