"""A recorded run as a device: stored raw values or the rig's scaling turned around, gaps, the end."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.devices.protocol import RAW_CHANNELS, Device, DeviceFault, DeviceLost
from fingerlab.devices.replay import Replay
from fingerlab.sessions import open_session


def all_of(device: Replay) -> list:
    device.open()
    device.start()
    return [device.exchange(5.0) for _ in range(device.length)]


def test_volts_follow_from_the_stored_quantities(make_session) -> None:
    path = make_session()
    device = Replay(path, "002")
    assert isinstance(device, Device)
    samples = all_of(device)
    raw = np.array([s.raw for s in samples]).T
    run = open_session(path).runs[1]
    # Thesis equation 2.1, KMA210 at 40 degrees a volt around 2.5 V, ADS 50/5 at -0.8 V/A, 8600 counts.
    np.testing.assert_allclose(11.194 * raw[0] - 5.317, run.channel("endpoint_force"), atol=1e-5)
    np.testing.assert_allclose(40 * (raw[1] - 2.5), np.degrees(run.channel("mcp_angle")), atol=1e-4)
    np.testing.assert_allclose(-raw[3] / 0.8, run.channel("motor_current"), atol=1e-6)
    assert np.array_equal(raw[4], np.round(run.channel("motor_position") / (2 * math.pi) * 8600))
    assert [s.index for s in samples] == list(range(4000))


def test_stored_raw_values_are_given_as_they_are(make_session) -> None:
    stored = np.arange(4000) % 7 / 10

    def add_raw(file: h5py.File) -> None:
        for k, name in enumerate(RAW_CHANNELS):
            dataset = file["runs/001"].create_dataset(f"raw/{name}", data=stored + k)
            dataset.attrs["units"] = "V"
            dataset.dims[0].attach_scale(file["runs/001/time"])

    raw = np.array([s.raw for s in all_of(Replay(make_session(change=add_raw)))]).T
    for k in range(5):
        assert np.array_equal(raw[k], stored + k)


def test_the_digital_inputs_are_played_back_where_they_were_recorded(make_session) -> None:
    pressed = (np.arange(4000) >= 3000).astype(float)

    def add_line(file: h5py.File) -> None:
        dataset = file["runs/001"].create_dataset("raw/emergency_stop", data=pressed)
        dataset.attrs["units"] = ""
        dataset.dims[0].attach_scale(file["runs/001/time"])

    stop, ready = np.array([s.lines for s in all_of(Replay(make_session(change=add_line)))]).T
    assert np.array_equal(stop, pressed)
    assert np.isnan(ready).all()  # no such line was recorded


def test_a_load_cell_that_was_not_read_is_nan(make_session) -> None:
    samples = all_of(Replay(make_session()))
    assert all(math.isnan(s.raw[0]) for s in samples)
    assert not any(math.isnan(v) for s in samples for v in s.raw[1:])


def test_gaps_stay_gaps_also_over_long_runs(make_session) -> None:
    def cut(file: h5py.File) -> None:
        time = file["runs/001/time"][:]
        time[9000:] += 0.025
        file["runs/001/time"][:] = time

    samples = all_of(Replay(make_session(change=cut, samples=20000)))
    steps = np.diff([s.index for s in samples])
    assert np.flatnonzero(steps != 1).tolist() == [8999]
    assert steps[8999] == 26


def test_order_of_calls_and_the_end(make_session) -> None:
    device = Replay(make_session(samples=50))
    with pytest.raises(DeviceFault, match="not open"):
        device.start()
    first = all_of(device)
    with pytest.raises(DeviceLost, match="has come to its end"):
        device.exchange(0.0)
    assert device.make_safe()
    with pytest.raises(DeviceFault, match="not running"):
        device.set_enable(True)
    device.start()
    assert device.exchange(0.0).raw[1:] == first[0].raw[1:]
    with pytest.raises(DeviceFault, match="running already"):
        device.start()
    device.close()
    with pytest.raises(DeviceFault, match="not running"):
        device.exchange(0.0)


def test_what_cannot_be_replayed(make_session, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no run '009'; it holds 001, 002"):
        Replay(make_session(), "009")
    with pytest.raises(UserError, match="does not exist"):
        Replay(tmp_path / "none.h5")


def test_a_file_that_vanishes_is_a_lost_device(make_session) -> None:
    path = make_session(samples=20000)
    device = Replay(path)
    device.open()
    device.start()
    for _ in range(8192):
        device.exchange(0.0)
    path.unlink()
    with pytest.raises(DeviceLost, match="does not exist"):
        device.exchange(0.0)


def test_a_real_recording(shared_data: Path) -> None:
    path = shared_data / "bench-thesis-protocol.h5"
    device = Replay(path)
    device.open()
    device.start()
    counts = np.array([device.exchange(0.0).raw[4] for _ in range(5000)])
    position = open_session(path).runs[0].channel("motor_position", 0, 5000)
    np.testing.assert_allclose(counts * 2 * math.pi / 8600, position, atol=math.pi / 8600 + 1e-6)
