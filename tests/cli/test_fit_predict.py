"""``fit`` and ``predict`` as a user calls them: files in, tables, JSON, model files and pictures out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure

from fingerlab.models.file import load_model
from fingerlab.sessions import open_session
from tests.cli.calling import refused, run_command

SAMPLES = 8000
PNG = b"\x89PNG"


@pytest.fixture
def session_file(make_session) -> Path:
    return make_session(samples=SAMPLES)


def slow(file: h5py.File) -> None:
    """Every hundredth sample of each run: 10 Hz."""
    for run in file["runs"].values():
        run.attrs["sample_rate_hz"] = 10.0
        for name in list(run):
            values, unit = run[name][::100], run[name].attrs["units"]
            del run[name]
            run[name] = values
            run[name].attrs["units"] = unit


def test_a_session_of_10_hz_is_read_fitted_and_exported(make_session, tmp_path: Path, capsys) -> None:
    """Of a motion of 1 Hz without noise it tells nearly the arms that 1 kHz tell."""
    arms: dict[str, list[float]] = {"mcp": [], "pip": []}
    for name, change in (("fast.h5", None), ("slow.h5", slow)):
        path = make_session(name, change, (("on_air", "extension"),), samples=60_000)
        assert run_command("fit", path, "--method", "whole", "--json", "-") == 0
        joints = json.loads(capsys.readouterr().out)["cables"]["extension"]["joints"]
        for joint, found in arms.items():
            found.append(joints[joint]["whole"]["moment_arm"]["value"])
    for fast, few in arms.values():
        assert few == pytest.approx(fast, rel=0.01)
    assert run_command("info", path) == 0
    assert run_command("export", path, "--to", "csv", "--out", tmp_path / "csv") == 0


@pytest.fixture
def model_file(session_file: Path, tmp_path: Path, capsys) -> Path:
    path = tmp_path / "M.json"
    assert run_command("fit", session_file, "--model", path) == 0
    capsys.readouterr()
    return path


def test_fit_prints_a_table_with_units(session_file: Path, capsys) -> None:
    assert run_command("fit", session_file) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for words in ("moment arm (mm)", "friction loss (mN m)", "static 2", "extension cable, run 001", "±"):
        assert words in out


@pytest.mark.parametrize(
    ("options", "regions"),
    [
        ((), {"flexion", "static_1", "extension", "static_2"}),
        (
            ("--method", "flexion-extension", "--delay", "findsignal", "--threshold", "30"),
            {"flexion", "extension"},
        ),
        (("--method", "whole", "--delay", "xcorr"), {"whole"}),
    ],
)
def test_fit_json_alone_on_standard_output(session_file: Path, options, regions, capsys) -> None:
    assert run_command("fit", session_file, *options, "--json", "-") == 0
    data = json.loads(capsys.readouterr().out)
    joints = data["cables"]["extension"]["joints"]
    assert set(joints) == {"mcp", "pip"}
    assert set(joints["pip"]) == regions
    for result in joints["pip"].values():
        assert result["moment_arm"]["unit"] == "m"
        assert result["friction_loss"]["unit"] == "N m"
        assert [one["run"] for one in result["by_run"]] == ["001"]


def test_model_file_keeps_the_fit(session_file: Path, tmp_path: Path, capsys) -> None:
    """The extension cable's slope of this session: springs and gravity fall as tension rises."""
    model, table = tmp_path / "M.json", tmp_path / "fit.json"
    assert run_command("fit", session_file, "--method", "whole", "--model", model, "--json", table) == 0
    capsys.readouterr()
    kept = load_model(model)
    result = json.loads(table.read_text(encoding="utf-8"))["cables"]["extension"]["joints"]["pip"]["whole"]
    parameter = kept.parameters["extension/pip/whole/moment_arm"]
    assert parameter.value == result["moment_arm"]["value"]
    # 10° of PIP per 0.2 A: K theta swings 10.5 mN m, T by 0.2 * 0.0302 * 4.3 / 0.015 = 1.73 N; gravity adds.
    assert parameter.value == pytest.approx(0.06 * np.radians(10) / 1.7315, rel=0.1)
    assert kept.sessions[0].name == "session.h5"
    assert kept.method == "whole"


@pytest.fixture
def heads(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What stands above every figure that is written."""
    told: list[str] = []
    write = Figure.savefig

    def keep(figure: Figure, *args: Any, **options: Any) -> None:
        told.append(" ".join(figure.get_suptitle().split()))
        write(figure, *args, **options)

    monkeypatch.setattr(Figure, "savefig", keep)
    return told


def test_figures_are_pictures(
    session_file: Path, model_file: Path, tmp_path: Path, capsys, heads: list[str]
) -> None:
    folder = tmp_path / "figures"
    assert run_command("predict", session_file, "--model", model_file, "--figures", folder) == 0
    pictures = sorted(folder.iterdir())
    assert {p.name for p in pictures} >= {"force-pip-extension-cable.png", "peaks-mcp-extension-cable.png"}
    assert all(p.read_bytes().startswith(PNG) for p in pictures)
    day, (run,) = open_session(session_file).created[:10], open_session(session_file).contact_runs()
    source = f"{session_file.name}, recorded {day}; {model_file.name}; run {run.name}"
    assert f"Mean peak of the endpoint force, by run – {source}" in heads
    assert len(heads) == len(pictures)
    assert all(head.endswith(f" – {source}") for head in heads)


def test_fit_draws_the_thesis_figures(session_file: Path, tmp_path: Path, capsys, heads: list[str]) -> None:
    folder = tmp_path / "figures"
    assert run_command("fit", session_file, "--figures", folder) == 0
    names = {p.name for p in folder.iterdir()}
    assert {"figure-4-02-regions.png", "figure-4-15-r2-means.png", "figure-5-02-contact-angle.png"} <= names
    assert all(f" – {session_file.name}, recorded " in head and "cable; " in head for head in heads)
    assert "does not exist" in refused(capsys, "fit", session_file, "--figures", tmp_path / "no" / "figures")


def test_predict_compares_with_the_load_cell(session_file: Path, model_file: Path, capsys) -> None:
    assert run_command("predict", session_file, "--model", model_file, "--json", "-") == 0
    data = json.loads(capsys.readouterr().out)
    for one in data["predictions"]:
        assert one["peak_measured"] == pytest.approx(1.5, abs=1e-3)  # 1 N + 0.5 N, as written
        assert one["share"] == pytest.approx(one["by_run"][0]["peak_modelled"] / 1.5, rel=1e-2)
    assert {one["equation"] for one in data["predictions"]} == {"endpoint_force_pip", "endpoint_force_mcp"}
    assert run_command("predict", session_file, "--model", model_file) == 0
    assert "1 contact runs" not in capsys.readouterr().out


def test_predict_without_load_cell_shows_the_model_only(make_session, model_file: Path, capsys) -> None:
    def forget(file: h5py.File) -> None:
        del file["runs/002/endpoint_force"]

    path = make_session("no-cell.h5", forget, samples=SAMPLES)
    assert run_command("predict", path, "--model", model_file) == 0
    assert "No load cell" in capsys.readouterr().out
    assert run_command("predict", path, "--model", model_file, "--json", "-") == 0
    assert json.loads(capsys.readouterr().out)["predictions"][0]["r2"] is None


def test_motor_bench_session(make_session, tmp_path: Path, model_file: Path, capsys) -> None:
    path = make_session(
        "bench.h5", phases=(("motor_bench", "none"), ("motor_bench", "none")), samples=SAMPLES
    )
    bench_model = tmp_path / "J.json"
    assert run_command("fit", path, "--model", bench_model) == 0
    out = capsys.readouterr().out
    assert "motor-bench runs only" in out
    assert "gain was not fitted" in out
    assert set(load_model(bench_model).parameters) == {"inertia", "offset"}
    assert "no contact run" in refused(capsys, "predict", path, "--model", model_file)
    assert "no moment arms" in refused(capsys, "predict", path, "--model", bench_model)
    assert "--figures" in refused(capsys, "fit", path, "--figures", tmp_path / "f")


def test_no_on_air_run(make_session, tmp_path: Path, capsys) -> None:
    path = make_session("c.h5", phases=(("contact", "flexion"),), samples=SAMPLES)
    assert "no run on air" in refused(capsys, "fit", path, "--model", tmp_path / "M.json")
    assert not (tmp_path / "M.json").exists()


def test_refusals_write_nothing(session_file: Path, model_file: Path, tmp_path: Path, capsys) -> None:
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    assert "exists already" in refused(capsys, "fit", session_file, "--model", model_file)
    assert "exists already" in refused(capsys, "fit", session_file, "--json", model_file)
    assert "does not exist" in refused(capsys, "fit", session_file, "--json", tmp_path / "no" / "x.json")
    assert "is a file" in refused(capsys, "fit", session_file, "--figures", model_file)
    assert "belongs to a region" in refused(
        capsys,
        "fit",
        session_file,
        "--method",
        "whole",
        "--delay",
        "findsignal",
        "--model",
        tmp_path / "x.json",
    )
    assert "does not exist" in refused(capsys, "predict", session_file, "--model", tmp_path / "absent.json")
    assert "give a model file" in refused(capsys, "predict", session_file, "--model", session_file)
    assert "threshold" in refused(capsys, "fit", session_file, "--threshold", "15")
    assert run_command("fit", tmp_path / "absent.h5") == 2
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_rig_without_finger_or_pulley(make_session, capsys) -> None:
    def without(part: str, key: str | None):
        def change(file: h5py.File) -> None:
            rig = json.loads(file.attrs["rig"])
            if key is None:
                del rig[part]
            else:
                del rig[part][key]
            file.attrs["rig"] = json.dumps(rig)

        return change

    path = make_session("f.h5", without("finger", None), samples=SAMPLES)
    assert "finger" in refused(capsys, "fit", path)
    path = make_session("p.h5", without("motor", "pulley_radius"), samples=SAMPLES)
    assert "pulley_radius" in refused(capsys, "fit", path)


def test_missing_angle_channel(make_session, capsys) -> None:
    def forget(file: h5py.File) -> None:
        del file["runs/001/pip_angle"]

    assert "pip_angle" in refused(capsys, "fit", make_session("a.h5", forget, samples=SAMPLES))


@pytest.mark.parametrize("name", ["bench-slack", "bench-thesis-protocol", "sealed-1", "cable-tool"])
def test_foreign_recordings(name: str, shared_data: Path, tmp_path: Path, capsys) -> None:
    path, model = shared_data / f"{name}.h5", tmp_path / "M.json"
    assert run_command("fit", path, "--model", model) == 0
    with h5py.File(path) as file:
        contact = any(run.attrs["phase"] == "contact" for run in file["runs"].values())
    assert run_command("predict", path, "--model", model) == (0 if contact else 2)
