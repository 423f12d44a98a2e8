"""One short session with an effect, and what the command line says of it, for all tests of commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from .calling import call


@pytest.fixture(scope="session")
def session_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fifty seconds of the simulated rig with Coulomb friction in the joints."""
    from fingerlab.twin.effects import parse_effects
    from fingerlab.twin.protocols import RunPlan, load_preset
    from fingerlab.twin.session import write_session

    def move(phase: str, cable: str, kind: str, amplitude: float, hertz: float, **more: float) -> RunPlan:
        wave = {"kind": kind, "amplitude_deg": amplitude, "frequency_hz": hertz, "duration_s": 10.0, **more}
        return RunPlan(phase, cable, wave)

    preset = load_preset("practice")
    press = preset.numbers["protocol"]["contact_amplitude_deg"]
    plans = [
        move("on_air", "extension", "sine", 15.0, 1.0, offset_deg=22.0),
        move("on_air", "extension", "sine", 11.0, 0.5, offset_deg=22.0),
        move("on_air", "extension", "chirp", 11.0, 0.5, offset_deg=22.0, end_frequency_hz=2.5),
        move("on_air", "flexion", "sine", 9.0, 1.0, offset_deg=15.0),
        move("contact", "flexion", "sine", press, 1.0),
    ]
    path = tmp_path_factory.mktemp("diagnose") / "friction.h5"
    write_session(path, preset, "short", plans, parse_effects(["coulomb_friction"]), seed=3)
    return path


@pytest.fixture(scope="session")
def answer(session_file: Path) -> dict[str, Any]:
    """What ``--json -`` puts on standard output, which must be JSON and nothing else."""
    code, out, err = call("diagnose", session_file, "--json", "-")
    assert code == 0, err
    assert "Traceback" not in err
    result: dict[str, Any] = json.loads(out)
    return result
