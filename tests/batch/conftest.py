"""A bench that ages: short recordings whose cable offset grows by a known millimetre a month."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest

from fingerlab.sessions import copy_session
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.session import write_session

PULLEY_RADIUS = 0.015
MONTHS = 4
GROWTH = 1.0e-3  # m a month


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs of ten seconds: of five the floor is known too roughly to call a bench clean."""
    wave = {
        "kind": "sine",
        "amplitude_deg": 15.0,
        "frequency_hz": 1.0,
        "offset_deg": 22.0,
        "duration_s": 10.0,
    }
    plans = [RunPlan("on_air", "extension", {**wave, "frequency_hz": f}) for f in (1.0, 1.0, 0.5)]
    path = tmp_path_factory.mktemp("recorded") / "s.h5"
    write_session(path, load_preset("practice"), "short", plans, {}, seed=3)
    return path


def aged(source: Path, path: Path, created: str, offset: float = 0.0, **attributes: str) -> Path:
    """A copy taken at another time, with ``offset`` (m) more cable wound on the pulley throughout."""
    copy_session(source, path)
    with h5py.File(path, "r+") as file:
        file.attrs["created"] = created
        for name, value in attributes.items():
            file.attrs[name] = value
        for run in file["runs"].values():
            run["motor_position"][...] = run["motor_position"][...] + offset / PULLEY_RADIUS
    return path


@pytest.fixture(scope="session")
def bench(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree with four months of one bench, and three files that cannot be diagnosed. Not to be changed."""
    folder = tmp_path_factory.mktemp("bench")
    for month in range(MONTHS):
        place = folder / f"2026-{month % 2}"
        place.mkdir(exist_ok=True)
        created = f"2026-0{month + 1}-01T10:00:00+01:00"
        aged(
            recorded,
            place / f"m{month}.h5",
            created,
            GROWTH * month,
            title=f"month {month}",
            operator="Łucja",
        )
    (folder / "not hdf5.h5").write_text("nothing of the kind", encoding="utf-8")
    with h5py.File(folder / "other.hdf5", "w") as file:
        file["x"] = [1, 2, 3]
    hole = aged(recorded, folder / "2026-1" / "hole.h5", "2026-05-01T10:00:00+01:00")
    with h5py.File(hole, "r+") as file:
        file["runs/002/mcp_angle"][3000] = float("nan")
    (folder / "notes.txt").write_text("no session", encoding="utf-8")
    return folder
