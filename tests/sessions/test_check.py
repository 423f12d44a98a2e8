"""The streamed check: what it calls an error, what it only tells."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions import check_session, open_session, reading


def findings(path):
    return check_session(open_session(path)).findings


def set_samples(channel, where, value, run="001"):
    def change(file):
        file[f"runs/{run}/{channel}"][where] = value

    return change


def test_a_good_session_has_no_error(make_session):
    report = check_session(open_session(make_session()))
    assert report.errors == ()
    report.raise_first()
    # The on-air run of the sample has no load cell: 4000 samples of NaN.
    assert [(f.level, f.run) for f in report.findings] == [("note", "001")]
    assert report.runs[0].force_not_read == 4000


def test_recordings_from_outside_have_no_finding(shared_data):
    for name in ("bench-plain.h5", "cable-tool.h5", "sealed-1.h5"):
        assert findings(shared_data / name) == ()


@pytest.mark.parametrize("piece", [100, 1 << 17])
@pytest.mark.parametrize("index", [1, 100, 3999])
def test_time_that_runs_backwards_is_found_wherever_pieces_meet(make_session, monkeypatch, piece, index):
    monkeypatch.setattr(reading, "PIECE_SAMPLES", piece)
    path = make_session(change=set_samples("time", index, (index - 1.5) / 1000))
    (error,) = check_session(open_session(path)).errors
    assert f"run 001, time runs backwards at sample {index} " in error.text
    with pytest.raises(UserError, match="runs backwards"):
        check_session(open_session(path)).raise_first()


def test_nan_and_infinity_are_errors_but_for_the_force(make_session):
    path = make_session("nan.h5", set_samples("pip_angle", 1234, np.nan))
    (error,) = check_session(open_session(path)).errors
    assert "channel 'pip_angle' holds NaN at sample 1234" in error.text
    path = make_session("inf.h5", set_samples("endpoint_force", 5, np.inf))
    (error,) = check_session(open_session(path)).errors
    assert "channel 'endpoint_force' holds an infinite number at sample 5" in error.text


def test_every_bad_run_is_reported_and_the_first_is_raised(make_session):
    def change(file):
        file["runs/001/mcp_angle"][3] = np.nan
        file["runs/002/time"][7] = 0.0

    report = check_session(open_session(make_session(change=change)))
    assert [error.run for error in report.errors] == ["001", "002"]


def test_a_wrong_sampling_rate_is_an_error_that_says_the_right_one(make_session):
    def change(file):
        file["runs/001"].attrs["sample_rate_hz"] = 100.0

    (error,) = check_session(open_session(make_session(change=change))).errors
    assert "says 100 samples a second, but its time channel holds 1000 a second" in error.text


def test_gaps_are_counted_with_the_samples_lost_in_them(make_session):
    def change(file):
        time = file["runs/001/time"][:]
        time[1000:] += 0.005  # five samples lost
        time[3000:] += 0.001  # one more
        file["runs/001/time"][:] = time

    report = check_session(open_session(make_session(change=change)))
    assert (report.runs[0].gaps, report.runs[0].lost_samples) == (2, 6)
    assert report.errors == ()


def test_a_torque_that_is_not_the_currents_is_told(make_session):
    """A file whose torque was written with gear ratio 4 instead of 4.3 is 7 % off."""

    def change(file):
        file["runs/001/motor_torque"][:] = 0.0302 * 4.0 * file["runs/001/motor_current"][:]

    texts = [f.text for f in findings(make_session(change=change)) if f.level == "warning"]
    assert len(texts) == 1
    assert "0.1208 N m/A" in texts[0]
    assert "0.1299 N m/A" in texts[0]


def test_a_contact_run_without_force_is_told(make_session):
    def change(file):
        del file["runs/002/endpoint_force"]

    assert any("without the fingertip's force" in f.text for f in findings(make_session(change=change)))


def test_bad_samples_are_refused_at_their_first_use_too(make_session):
    """Whoever does not check first still gets a sentence, not a number made of NaN."""
    session = open_session(make_session(change=set_samples("time", 50, 0.0)))
    with pytest.raises(UserError, match="run 001, time runs backwards at sample 50"):
        session.runs[0].channel("time")
    with pytest.raises(UserError, match="run 001, time runs backwards at sample 50"):
        session.runs[0].load()
    assert session.runs[1].load()["time"].size == 4000
