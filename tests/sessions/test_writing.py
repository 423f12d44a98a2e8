"""What the writer writes, seen by other readers; and what it leaves behind when it cannot."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.rig.file import default_rig
from fingerlab.sessions import SessionWriter, check_session, open_session
from fingerlab.sessions.disk_files import TargetFile

RATE = 500.0


def channels(samples: int = 1000) -> dict[str, np.ndarray]:
    time = np.arange(samples) / RATE
    swing = np.sin(2 * np.pi * time)
    return {
        "time": time,
        "motor_command": 0.3 * swing,
        "motor_position": 0.29 * swing,
        "motor_current": 0.5 * swing,
        "motor_torque": 0.0302 * 4.3 * 0.5 * swing,
        "mcp_angle": -0.2 * swing,
        "pip_angle": -0.1 * swing,
        "endpoint_force": np.where(time > 1, swing, np.nan),
    }


def write(path: Path, **options) -> Path:
    with SessionWriter(path, default_rig(), "Übung № 1", **options) as writer:
        writer.add_run("on_air", "extension", RATE, {"kind": "sine", "amplitude_deg": 15.0}, channels())
        extra = {**channels(), "thermistor": np.full(1000, 21.5)}
        writer.add_run(
            "contact",
            "flexion",
            RATE,
            {"kind": "steps"},
            extra,
            {"complete": False, "dropped_samples": 3, "started": "2026-11-01T09:00:00+00:00", "none": None},
            units={"thermistor": "degC", "load_cell": "V"},
            raw={"load_cell": np.arange(1000, dtype=np.int16)},
        )
    return path


def test_what_was_written_is_read(tmp_path):
    session = open_session(write(tmp_path / "a.h5", attributes={"operator": "Ada", "tags": ["first", "θ"]}))
    assert session.title == "Übung № 1"
    assert session.rig == default_rig()
    assert json.loads(session.attributes["tags"]) == ["first", "θ"]
    assert session.attributes["software"] == f"FingerLab {fingerlab.__version__}"
    assert session.created[10] == "T"
    assert session.created[-6] in "+-"
    for run in session.runs:
        for name, values in channels().items():
            np.testing.assert_array_equal(run.channel(name), values)
    second = session.runs[1]
    assert second.units["thermistor"] == "degC"
    assert second.units["raw/load_cell"] == "V"
    assert second.attributes["dropped_samples"] == 3
    assert second.attributes["complete"] == 0
    assert "none" not in second.attributes
    texts = [finding.text for finding in check_session(session).findings if finding.level == "warning"]
    assert any("3 samples were dropped" in text for text in texts)
    assert any("before the trajectory was complete" in text for text in texts)


def test_the_layout_is_the_contracts(tmp_path):
    """h5read(file, '/runs/001/mcp_angle') wants a plain one-dimensional dataset of numbers there."""
    with h5py.File(write(tmp_path / "a.h5")) as file:
        assert file.attrs["format"] == "fingerlab-session"
        assert file.attrs["format_version"] == "1"
        assert h5py.check_string_dtype(file.attrs.get_id("title").dtype).encoding == "utf-8"
        for name, values in channels().items():
            dataset = file[f"/runs/001/{name}"]
            assert dataset.shape == values.shape
            assert dataset.dtype == np.dtype("<f8")
            assert dataset.compression == "gzip"
            if name != "time":
                assert dataset.dims[0]["time"] == file["/runs/001/time"]
        assert file["/runs/001/time"].is_scale
        assert file["/runs/002/raw/load_cell"].dtype == np.dtype("<i2")
        assert file["/runs/001"].attrs["sample_rate_hz"] == 500.0


@pytest.mark.parametrize("float32", [False, True])
def test_xarray_opens_what_we_write(tmp_path, float32):
    path = write(tmp_path / "a.h5", float32=float32)
    kind = np.float32 if float32 else np.float64
    with xr.open_dataset(path, engine="h5netcdf", group="/runs/002") as data:
        np.testing.assert_array_equal(data["time"].values, channels()["time"])
        assert data["time"].dims == ("time",)
        assert data["time"].attrs["units"] == "s"
        assert data.attrs["phase"] == "contact"
        for name, values in channels().items():
            if name != "time":
                assert data[name].dims == ("time",)
                np.testing.assert_array_equal(data[name].values, values.astype(kind))
        assert data["motor_torque"].attrs["units"] == "N m"
        assert float(data["mcp_angle"].sel(time=0.25, method="nearest")) == pytest.approx(-0.2, abs=1e-6)
    with xr.open_dataset(path, engine="h5netcdf") as root:
        assert root.attrs["title"] == "Übung № 1"


def test_xarray_opens_every_recording_from_outside(shared_data):
    for path in sorted(shared_data.glob("*.h5")):
        run = open_session(path).runs[-1]
        with xr.open_dataset(path, engine="h5netcdf", group=f"/runs/{run.name}") as data:
            assert set(data.variables) == set(run.units)
            for name, unit in run.units.items():
                assert data[name].attrs["units"] == unit
                np.testing.assert_array_equal(data[name].values.astype(np.float64), run.channel(name))


def test_pieces_make_the_same_run_as_the_whole(tmp_path):
    whole = channels(40_000)
    with SessionWriter(tmp_path / "pieces.h5", default_rig(), "pieces") as writer:
        run = writer.begin_run("on_air", "extension", RATE, {"kind": "sine"})
        for start in (0, 1, 17_000):
            stop = {0: 1, 1: 17_000, 17_000: 40_000}[start]
            run.append({name: values[start:stop] for name, values in whole.items()})
        run.finish()
    data = open_session(tmp_path / "pieces.h5").runs[0].load()
    for name, values in whole.items():
        np.testing.assert_array_equal(data[name], values)


def test_time_may_not_step_back_between_pieces(tmp_path):
    with SessionWriter(tmp_path / "a.h5", default_rig(), "x") as writer:
        run = writer.begin_run("on_air", "extension", RATE, {})
        run.append(channels())
        late = channels()
        late["time"] = late["time"] + channels()["time"][-1]
        with pytest.raises(UserError, match="time stands still at sample 1000"):
            run.append(late)
    assert open_session(tmp_path / "a.h5").runs[0].length == 1000


def test_time_is_counted_where_it_is_not_given(tmp_path):
    data = channels()
    del data["time"]
    with SessionWriter(tmp_path / "a.h5", default_rig(), "x") as writer:
        writer.add_run("on_air", "extension", RATE, {}, data)
    np.testing.assert_array_equal(open_session(tmp_path / "a.h5").runs[0].channel("time"), channels()["time"])


def broken(**changes) -> dict[str, np.ndarray]:
    return {key: value for key, value in {**channels(), **changes}.items() if value is not None}


def nan_at(name: str, index: int) -> dict[str, np.ndarray]:
    values = channels()[name].copy()
    values[index] = np.nan
    return {name: values}


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("walking", "extension", RATE, {}, channels()), "phase 'walking'; it should be one of on_air"),
        (("on_air", "rope", RATE, {}, channels()), "cable 'rope'; it should be one of extension"),
        (("on_air", "extension", 0.0, {}, channels()), "sample rate 0.0; it should be a positive number"),
        (("on_air", "extension", RATE, {}, broken(mcp_angle=None)), "lacks the channel 'mcp_angle'"),
        (("on_air", "extension", RATE, {}, broken(mcp_angle=np.zeros(9))), "of one length"),
        (
            ("on_air", "extension", RATE, {}, broken(**nan_at("pip_angle", 7))),
            "'pip_angle' holds NaN at sample 7",
        ),
        (
            ("on_air", "extension", RATE, {}, broken(time=-channels()["time"])),
            "time runs backwards at sample 1",
        ),
        (("on_air", "extension", RATE, {}, {k: v[:0] for k, v in channels().items()}), "empty"),
        (("on_air", "extension", RATE, {}, broken(mcp_angle=np.array(["a"] * 1000))), "else than numbers"),
    ],
)
def test_a_run_that_breaks_the_format_leaves_nothing(tmp_path, arguments, sentence):
    with (
        pytest.raises(UserError, match=sentence),
        SessionWriter(tmp_path / "a.h5", default_rig(), "x") as writer,
    ):
        writer.add_run(*arguments)
    assert list(tmp_path.iterdir()) == []


def test_a_session_without_runs_is_not_written(tmp_path):
    with pytest.raises(UserError, match="would hold no runs"), SessionWriter(tmp_path / "a.h5", "{}", "x"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_the_caller_passes_through_and_leaves_nothing(tmp_path):
    def work():
        with SessionWriter(tmp_path / "a.h5", default_rig(), "x") as writer:
            writer.add_run("on_air", "extension", RATE, {}, channels())
            raise RuntimeError("the caller's own")

    with pytest.raises(RuntimeError, match="the caller's own"):
        work()
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes(b"precious")
    with pytest.raises(UserError, match="exists already and is not overwritten"):
        SessionWriter(path, default_rig(), "x")
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_is_taken_meanwhile_is_not_overwritten(tmp_path):
    path = tmp_path / "a.h5"
    writer = SessionWriter(path, default_rig(), "x")
    writer.add_run("on_air", "extension", RATE, {}, channels())
    path.write_bytes(b"someone else's")
    with pytest.raises(UserError, match="exists already"):
        writer.__exit__(None, None, None)
    assert path.read_bytes() == b"someone else's"
    assert list(tmp_path.iterdir()) == [path]


def test_two_writers_of_one_place_are_kept_apart(tmp_path):
    path = tmp_path / "a.h5"
    with SessionWriter(path, default_rig(), "first") as writer:
        with pytest.raises(UserError, match=r"a\.h5\.part is there already"):
            SessionWriter(path, default_rig(), "second")
        writer.add_run("on_air", "extension", RATE, {}, channels())
    assert open_session(path).title == "first"


def test_a_missing_folder_and_a_file_as_folder(tmp_path):
    with pytest.raises(UserError, match="does not exist; make it first"):
        SessionWriter(tmp_path / "no" / "a.h5", default_rig(), "x")
    (tmp_path / "file").write_text("x")
    with pytest.raises(UserError, match=r"The folder .*file does not exist"):
        SessionWriter(tmp_path / "file" / "a.h5", default_rig(), "x")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_read_only_place_is_one_sentence(tmp_path, monkeypatch):
    """Permissions do not stop an administrator, so the refusal is made here."""
    real = Path.open

    def refuse(self, mode="r", *arguments, **options):
        if "x" in mode:
            raise PermissionError(errno.EACCES, "Permission denied", str(self))
        return real(self, mode, *arguments, **options)

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(UserError, match=r"a\.h5 cannot be written \(Permission denied\); choose a place"):
        SessionWriter(tmp_path / "a.h5", default_rig(), "x")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt" or not hasattr(os, "geteuid") or os.geteuid() == 0, reason="as root")
def test_a_folder_without_write_permission(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(UserError, match="cannot be written"):
            SessionWriter(tmp_path / "a.h5", default_rig(), "x")
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("room", [0, 100, 2_000, 10_000, 60_000])
def test_a_disk_that_fills_up_at_any_moment_leaves_nothing(tmp_path, monkeypatch, room):
    """Quotas and network shares fill up where no free space could have been looked up before."""
    real = TargetFile.write

    def write_while_there_is_room(self, data):
        if self.tell() + len(data) > room:
            self.failure = OSError(errno.ENOSPC, "No space left on device")
        return real(self, data)

    monkeypatch.setattr(TargetFile, "write", write_while_there_is_room)
    with pytest.raises(UserError, match=r"a\.h5 cannot be written \(No space left on device\)"):
        write(tmp_path / "a.h5")
    assert list(tmp_path.iterdir()) == []


FILL = """
import sys
import numpy as np
from fingerlab.core.errors import UserError
from fingerlab.rig.file import default_rig
from fingerlab.sessions import SessionWriter
noise = np.random.default_rng(1).normal(size=400_000)
try:
    with SessionWriter(sys.argv[1], default_rig(), "x") as writer:
        writer.add_run("motor_bench", "none", 1000.0, {}, {"motor_position": noise, "motor_torque": noise})
except UserError as error:
    print(error)
    sys.exit(2)
"""


def test_a_full_disk_is_one_sentence_and_leaves_nothing(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    try:
        mounted = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)], capture_output=True, timeout=20
        )
    except OSError as error:
        pytest.skip(f"a small disk cannot be mounted here: {error}")
    if mounted.returncode:
        pytest.skip(f"a small disk cannot be mounted here: {mounted.stderr.decode().strip()}")
    try:
        command = [sys.executable, "-c", FILL, str(disk / "a.h5")]
        result = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert result.returncode == 2, result.stderr
        assert "a.h5 cannot be written (No space left on device); choose a place with room" in result.stdout
        assert len(result.stdout.strip().splitlines()) == 1
        assert result.stderr == ""
        assert list(disk.iterdir()) == []
    finally:
        subprocess.run(["umount", str(disk)], check=True, timeout=20)


FINITE = st.floats(allow_nan=False, allow_infinity=False, width=64)
TEXT = st.characters(
    codec="utf-8", exclude_categories=("Cc", "Cf", "Cs", "Zl", "Zp"), include_characters="\n\t"
)
"""What steers no terminal; what does is written out where a file is read."""


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    length=st.integers(1, 60),
    text=st.text(TEXT),
)
def test_any_session_comes_back_as_it_was(tmp_path_factory, data, length, text):
    path = tmp_path_factory.mktemp("round") / "a.h5"
    arrays = hnp.arrays(np.float64, length, elements=FINITE)
    steps = data.draw(hnp.arrays(np.float64, length, elements=st.floats(1e-6, 10.0)))
    run = {"time": np.cumsum(steps), "motor_position": data.draw(arrays), "motor_torque": data.draw(arrays)}
    run["endpoint_force"] = data.draw(
        hnp.arrays(np.float64, length, elements=st.floats(allow_infinity=False))
    )
    trajectory = data.draw(
        st.dictionaries(
            st.text(TEXT, max_size=5), FINITE | st.text(TEXT, max_size=5) | st.booleans(), max_size=4
        )
    )
    rate = data.draw(st.floats(1e-3, 1e6))
    with SessionWriter(path, default_rig(), text, attributes={"notes": text}) as writer:
        writer.add_run("free", "none", rate, trajectory, run)
    session = open_session(path)
    assert session.title == text
    assert session.attributes["notes"] == text
    (back,) = session.runs
    assert dict(back.trajectory) == trajectory
    assert back.sample_rate_hz == rate
    for name, values in run.items():
        np.testing.assert_array_equal(back.channel(name), values)
