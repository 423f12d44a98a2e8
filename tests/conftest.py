"""What every test can ask for. Windows are off screen and figures have no display, wherever tests run."""

from __future__ import annotations

import gc
import json
import math
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

# Before numpy is imported. The suite has both cores in hand already: threads of linear algebra that wait for
# one another there made tests of the sums take ten times as long as with one.
os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"
os.environ["VECLIB_MAXIMUM_THREADS"] = "1"

import h5py
import numpy as np
import pytest

import fingerlab.core.progress

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ["MPLBACKEND"] = "Agg"

# Tests start some hundred processes, of which each would compile all that it imports of the project anew.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

ROOT = Path(__file__).resolve().parents[1]
# Effects that somebody made for themselves on this machine must not take part in the tests.
os.environ["FINGERLAB_SETTINGS_DIR"] = str(ROOT / "tests" / "no-settings")


def pytest_collection_finish() -> None:
    """What stays to the end is not looked through for garbage again, some ten thousand times."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _no_second_process() -> Iterator[None]:
    """The tests have both cores in hand; a second process of a diagnosis has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fingerlab.core.progress, "WORTH_BYTES", math.inf)
        yield


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the recordings that the project did not make; the test is skipped where it is absent."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"the recordings that the project did not make are not at {folder}")
    return folder


MakeSession = Callable[..., Path]


@pytest.fixture
def make_session(tmp_path: Path) -> MakeSession:
    """A function that writes a small good session with plain h5py, apart from the project's own writer.

    ``make_session(name, change=f)`` calls ``f(file)`` on the open h5py file before it is closed, so that a
    test can break exactly one thing.
    """

    def make(
        name: str = "session.h5",
        change: Callable[[h5py.File], None] | None = None,
        phases: tuple[tuple[str, str], ...] = (("on_air", "extension"), ("contact", "flexion")),
        samples: int = 4000,
    ) -> Path:
        path = tmp_path / name
        write_plain_session(path, change, phases, samples)
        return path

    return make


RIG = {
    "finger": {
        "proximal_mass": 0.012,
        "distal_mass": 0.013,
        "proximal_half_length": 0.0225,
        "distal_half_length": 0.024,
        "proximal_inertia": 2.025e-6,
        "distal_inertia": 2.496e-6,
        "mcp_stiffness": 0.12,
        "pip_stiffness": 0.06,
        "wrist_angle": math.radians(15),
        "gravity": 9.81,
    },
    "motor": {"torque_constant": 0.0302, "gear_ratio": 4.3, "pulley_radius": 0.015},
    "tolerance": {"mcp_stiffness": 0.1},
}


def write_plain_session(
    path: Path,
    change: Callable[[h5py.File], None] | None = None,
    phases: tuple[tuple[str, str], ...] = (("on_air", "extension"), ("contact", "flexion")),
    samples: int = 4000,
    libver: str | None = None,
) -> None:
    """What ``make_session`` writes."""
    with h5py.File(path, "w", libver=libver) as file:
        file.attrs["format"] = "fingerlab-session"
        file.attrs["format_version"] = "1"
        file.attrs["created"] = "2026-11-01T09:00:00+01:00"
        file.attrs["title"] = "Ring finger, Łódź"
        file.attrs["rig"] = json.dumps(RIG)
        for number, (phase, cable) in enumerate(phases, start=1):
            _write_plain_run(file.create_group(f"runs/{number:03d}"), phase, cable, samples)
        if change is not None:
            change(file)


def _write_plain_run(group: h5py.Group, phase: str, cable: str, samples: int) -> None:
    group.attrs["phase"] = phase
    group.attrs["cable"] = cable
    group.attrs["sample_rate_hz"] = 1000.0
    group.attrs["trajectory"] = json.dumps({"kind": "sine", "amplitude_deg": 15.0, "frequency_hz": 1.0})
    time = np.arange(samples) / 1000.0
    swing = np.sin(2 * np.pi * time)
    current = 0.3 + 0.2 * swing
    channels = {
        "motor_command": (np.radians(22 + 15 * swing), "rad"),
        "motor_position": (np.radians(22 + 14.9 * swing), "rad"),
        "motor_current": (current, "A"),
        "motor_torque": (0.0302 * 4.3 * current, "N m"),
    }
    if phase in ("on_air", "contact"):
        channels["mcp_angle"] = (np.radians(-10 - 8 * swing), "rad")
        channels["pip_angle"] = (np.radians(-17 - 10 * swing), "rad")
        force = 1 + 0.5 * swing if phase == "contact" else np.full(samples, np.nan)
        channels["endpoint_force"] = (force, "N")
    scale = group.create_dataset("time", data=time)
    scale.attrs["units"] = "s"
    scale.make_scale("time")
    for name, (values, unit) in channels.items():
        dataset = group.create_dataset(name, data=values.astype(np.float32), compression="gzip", shuffle=True)
        dataset.attrs["units"] = unit
        dataset.dims[0].attach_scale(scale)
