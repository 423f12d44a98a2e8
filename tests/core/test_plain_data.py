"""Files as typed data: defaults of sections, whole numbers with a point, a sentence for each mistake."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import Mismatch, structured
from fingerlab.rig.file import Rig


@dataclass(frozen=True)
class Sensor:
    terminal: str
    gain: float
    sign: int = 1


@dataclass(frozen=True)
class Bench:
    name: str
    sensor: Sensor = Sensor("ai0", 2.0)
    mode: Literal["fast", "slow"] = "slow"
    folder: str | None = None
    sources: dict[str, str] = field(default_factory=dict)


def test_what_is_left_out_has_the_default_of_its_section() -> None:
    found = structured(Bench, {"name": "b", "sensor": {"gain": 3, "sign": -1.0}, "later": 1})
    assert found == Bench("b", Sensor("ai0", 3.0, -1))
    assert isinstance(found.sensor.gain, float)
    assert vars(found) == {"name": "b", "sensor": found.sensor, "mode": "slow", "folder": None, "sources": {}}
    assert isinstance(found.sensor.sign, int)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({}, "lacks 'name'"),
        ({"name": 3}, "name is 3; it should be text in quotes"),
        ({"name": "b", "sensor": 3}, "sensor is not a section; it should hold terminal, gain, sign"),
        ({"name": "b", "sensor": {"gain": "two"}}, "sensor gain is 'two'; it should be a finite number"),
        ({"name": "b", "sensor": {"gain": True}}, "sensor gain is True; it should be a finite number"),
        ({"name": "b", "sensor": {"gain": float("nan")}}, "sensor gain is nan; it should be a finite number"),
        ({"name": "b", "sensor": {"sign": 0.5}}, "sensor sign is 0.5; it should be a whole number"),
        ({"name": "b", "mode": "idle"}, "mode is 'idle'; it should be one of fast, slow"),
        ({"name": "b", "folder": 3}, "folder is 3; it should be text in quotes"),
        ([], "is not a section; it should hold name, sensor, mode, folder, sources"),
    ],
)
def test_a_mistake_is_the_rest_of_a_sentence(data: object, says: str) -> None:
    with pytest.raises(Mismatch) as caught:
        structured(Bench, data)
    assert str(caught.value) == says


def test_unknown_names_can_be_refused() -> None:
    with pytest.raises(Mismatch, match="holds the unknown 'later'; it knows name, sensor"):
        structured(Bench, {"name": "b", "later": 1}, refuse_unknown=True)


@pytest.mark.parametrize(
    ("finger", "says"),
    [
        (
            {"proximal_mass": "heavy"},
            "'finger' holds 'proximal_mass' = 'heavy'; it should be a finite number",
        ),
        ({"proximal_mass": 0.01}, "'finger' lacks 'distal_mass'; it should be a number in SI units."),
        ([1], "'finger' is not an object of named numbers."),
    ],
)
def test_a_rig_text_says_which_constant_is_wrong(finger: object, says: str, tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        Rig.from_json(json.dumps({"finger": finger}), "S.h5, attribute 'rig'")
    assert str(caught.value).startswith(f"S.h5, attribute 'rig', {says}")


def test_a_rig_text_states_every_constant_that_its_reader_left_to_the_default() -> None:
    again = json.loads(Rig.from_json('{"motor": {"inertia": null}}').to_json())
    assert again == {"motor": {"torque_constant": 0.0302, "gear_ratio": 4.3}}
