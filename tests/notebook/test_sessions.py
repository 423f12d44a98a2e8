"""Sessions as objects and as xarray, against what h5py and xarray read from the same file."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.notebook.model import ShownTable, filled
from fingerlab.sessions import Run
from tests.stage import stage_session

MakeSession = Callable[..., Path]


def imported_by(code: str) -> set[str]:
    """Top-level modules that a new Python has imported after ``code``."""
    ask = f"{code}\nimport sys\nprint(' '.join(sorted({{name.split('.')[0] for name in sys.modules}})))"
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_importing_fingerlab_imports_nothing_else(make_session: MakeSession) -> None:
    heavy = {
        "numpy",
        "scipy",
        "h5py",
        "matplotlib",
        "numba",
        "PySide6",
        "pyqtgraph",
        "xarray",
        "rich",
        "click",
    }
    assert not heavy & imported_by("import fingerlab")
    path = make_session()
    opened = imported_by(f"import fingerlab; repr(fingerlab.open({str(path)!r}))")
    assert not {"scipy", "matplotlib", "xarray"} & opened
    opened = imported_by(f"import fingerlab; s = fingerlab.open({str(path)!r}); s.to_xarray()")
    assert {"h5py", "xarray"} <= opened
    assert not {"PySide6", "pyqtgraph", "numba"} & opened


def test_what_import_fingerlab_offers_is_listed_and_the_rest_is_refused() -> None:
    assert {"open", "diagnose", "fit", "load_model", "simulate", "catalogue"} <= set(dir(fingerlab))
    with pytest.raises(AttributeError, match="no attribute 'opne'"):
        fingerlab.opne  # type: ignore[attr-defined]  # noqa: B018


def test_one_recording_is_evidence_once(make_session: MakeSession, tmp_path: Path) -> None:
    path = make_session()
    session, copy = fingerlab.open(path), tmp_path / "copy.h5"
    shutil.copy(path, copy)
    for twice in ((path, path), (session, session), (str(path), session)):
        with pytest.raises(UserError, match="is given twice; give each session once"):
            fingerlab.diagnose(*twice)
    with pytest.raises(UserError, match="hold the same recording; give one of them"):
        fingerlab.diagnose(session, copy)
    with pytest.raises(UserError, match="hold the same recording"):
        fingerlab.fit(copy, path)


def test_a_run_as_xarray_holds_what_the_file_holds(make_session: MakeSession) -> None:
    path = make_session()
    data = fingerlab.open(path)["002"].to_xarray()
    with h5py.File(path) as file:
        group = file["runs/002"]
        assert set(data.data_vars) | {"time"} == set(group)
        for name in data.data_vars:
            np.testing.assert_array_equal(data[name], group[name][:])
            assert data[name].attrs["units"] == group[name].attrs["units"]
            assert data[name].dims == ("time",)
        np.testing.assert_array_equal(data["time"], group["time"][:])
    assert data.attrs["phase"] == "contact"
    assert json.loads(data.attrs["trajectory"])["frequency_hz"] == 1.0
    one = fingerlab.open(path)["001"].to_xarray(["mcp_angle"])
    assert list(one.data_vars) == ["mcp_angle"]


def test_a_session_as_xarray_is_what_xarray_itself_reads(make_session: MakeSession, tmp_path: Path) -> None:
    path = make_session()
    tree = fingerlab.open(path).to_xarray()
    assert list(tree.children) == ["001", "002"]
    for name in tree.children:
        with xarray.open_dataset(path, group=f"runs/{name}", engine="h5netcdf", decode_times=False) as file:
            ours = tree[name].to_dataset()
            for channel in ours.data_vars:
                np.testing.assert_allclose(ours[channel], file[channel], equal_nan=True)
    tree.to_netcdf(tmp_path / "kept.nc", engine="h5netcdf")
    with xarray.open_datatree(tmp_path / "kept.nc", engine="h5netcdf", decode_times=False) as kept:
        assert kept.attrs["title"] == "Ring finger, Łódź"
        np.testing.assert_array_equal(kept["001"]["mcp_angle"], tree["001"]["mcp_angle"])


def test_channels_as_read_get_a_name_that_xarray_takes() -> None:
    run = Run.from_arrays(
        {"motor_command": np.zeros(3), "raw/force": np.array([1.0, 2.0, 3.0])},
        units={"raw/force": "V"},
        attributes={"complete": np.True_},
    )
    from fingerlab.notebook.session import run_dataset

    data = run_dataset(run)
    assert data["raw_force"].values.tolist() == [1.0, 2.0, 3.0]
    assert data["raw_force"].attrs == {"units": "V"}
    assert data.attrs["complete"] == 1


def test_a_session_prints_its_runs_and_escapes_what_others_wrote(make_session: MakeSession) -> None:
    def rename(file: h5py.File) -> None:
        file.attrs["title"] = "<script>alert(1)</script>"

    session = fingerlab.open(make_session(change=rename))
    text = repr(session)
    assert text.splitlines()[0].startswith("session.h5: <script>")
    assert "2 runs, 8 s" in text
    assert "sine, 15°, 1 Hz" in text
    assert "<script>" not in session._repr_html_()
    run = session["002"]
    assert "in contact, flexion cable" in repr(run)
    assert run.channels["endpoint_force"] == "N"
    assert [one.name for one in session] == ["001", "002"]
    with pytest.raises(UserError, match="has no run '7'; it holds 001, 002"):
        session["7"]


def test_the_figure_of_a_run_shows_degrees(make_session: MakeSession) -> None:
    session = fingerlab.open(make_session())
    figure = session["001"].figure("mcp_angle")
    assert figure.axes[0].get_ylabel().endswith("(°)") or "deg" in figure.axes[0].get_ylabel()
    low, high = figure.axes[0].lines[0].get_ydata().min(), figure.axes[0].lines[0].get_ydata().max()
    assert (low, high) == pytest.approx((-18.0, -2.0), abs=1e-3)  # what conftest wrote: -10 -+ 8 degrees
    assert len(session["001"].figure().axes) == 3  # the force was not read in this run
    with pytest.raises(UserError, match="no channel 'mcp'"):
        session["001"].figure("mcp")


def test_a_table_aligns_numbers_at_the_right() -> None:
    table = ShownTable(("name", "n"), [("a", "1"), ("bcdef", "100")], frozenset({1}), "two & three")
    assert table.text() == "two & three\nname     n\na        1\nbcdef  100"
    assert "two &amp; three" in table.html()
    assert '<td style="text-align:right">100</td>' in table.html()


def test_a_number_stays_with_its_unit_where_a_line_ends() -> None:
    text = filled("a " * 41 + "lasts 600 s, and 90 % of it at 1000 Hz")
    assert text.splitlines() == [("a " * 41 + "lasts").strip(), "600 s, and 90 % of it at 1000 Hz"]


def test_wrong_words_get_one_sentence(make_session: MakeSession, tmp_path: Path) -> None:
    path = make_session()
    with pytest.raises(UserError, match="There is no protocol 'riche'"):
        fingerlab.simulate(tmp_path / "s.h5", "riche")
    with pytest.raises(UserError, match="leave out"):
        fingerlab.simulate(tmp_path / "s.h5", effects="coulomb_friction", hidden=True)
    with pytest.raises(UserError, match="gremlins"):
        fingerlab.diagnose(path, added="gremlins")
    with pytest.raises(UserError, match="No session"):
        fingerlab.fit()
    with pytest.raises(UserError, match="was not simulated"):
        fingerlab.open(path).reveal()
    assert not (tmp_path / "s.h5").exists()


def test_the_catalogue_prints_every_effect() -> None:
    catalogue = fingerlab.catalogue()
    assert len(catalogue) > 25
    text = repr(catalogue)
    assert all(name in text for name in catalogue)
    one = catalogue["coulomb_friction"]
    assert one.title in text
    shown = repr(one)
    assert shown.startswith("Coulomb joint friction (coulomb_friction), changes joint torque")
    gain = one.effect.gains["coulomb_mcp"]
    assert f"{gain.low:g} to {gain.high:g}" in shown
    assert f"What reveals it: {one.effect.reveal}." in " ".join(shown.split())


def test_a_run_of_a_linear_axis_is_drawn_in_mm_and_its_numbers_stay_those_of_the_file(tmp_path: Path) -> None:
    run = fingerlab.open(stage_session(tmp_path))["001"]
    assert "sine, 10 mm, 0.5 Hz" in repr(run)
    axes = run.figure("motor_position", "motor_torque").axes
    assert [one.get_ylabel() for one in axes] == ["position (mm)", "force (N)"]
    assert np.abs(axes[0].lines[0].get_ydata()).max() == pytest.approx(10.0, abs=1e-3)
    assert np.abs(run.to_xarray()["motor_position"]).max() == pytest.approx(1.0, abs=1e-4)  # rad
