"""Session files with one thing wrong each, and what should be said of them."""

from __future__ import annotations

import json

import h5py
import numpy as np


def missing(path, make_session):
    return path


def folder(path, make_session):
    path.mkdir()
    return path


def not_hdf5(path, make_session):
    path.write_text("time\tangle\n0\t1\n", encoding="utf-8")
    return path


def empty_file(path, make_session):
    path.write_bytes(b"")
    return path


def not_a_session(path, make_session):
    with h5py.File(path, "w") as file:
        file["measurements"] = [1.0, 2.0]
    return path


def cut_off(path, make_session):
    whole = make_session(path.name).read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    return path


def damaged(path, make_session):
    """The bytes of one compressed chunk are overwritten, as on a failing disk."""
    make_session(path.name)
    with h5py.File(path) as file:
        chunks = [run["mcp_angle"].id.get_chunk_info(0) for run in file["runs"].values()]
    with path.open("r+b") as file:
        for chunk in chunks:
            file.seek(chunk.byte_offset)
            file.write(b"\xff" * chunk.size)
    return path


def changed(change):
    return lambda path, make_session: make_session(path.name, change)


def newer(file):
    file.attrs["format_version"] = "2.1"


def strange_version(file):
    file.attrs["format_version"] = "new"


def no_runs(file):
    del file["runs/001"]
    del file["runs/002"]


def no_group(file):
    del file["runs"]


def no_rig(file):
    del file.attrs["rig"]


def bad_rig(file):
    file.attrs["rig"] = "{finger: 12 g}"


def rig_of_words(file):
    file.attrs["rig"] = json.dumps({"motor": {"gear_ratio": "four"}})


def rig_tolerance_of_words(file):
    rig = json.loads(file.attrs["rig"])
    file.attrs["rig"] = json.dumps({**rig, "tolerance": {"mcp_stiffness": "small"}})


def rig_without_finger(file):
    file.attrs["rig"] = json.dumps({"motor": {}})


def no_channel(file):
    del file["runs/001/pip_angle"]


def no_time(file):
    del file["runs/001/time"]


def no_phase(file):
    del file["runs/001"].attrs["phase"]


def bad_phase(file):
    file["runs/001"].attrs["phase"] = "in_the_air"


def bad_cable(file):
    file["runs/001"].attrs["cable"] = "rope"


def bad_rate(file):
    file["runs/001"].attrs["sample_rate_hz"] = -1.0


def rate_of_words(file):
    file["runs/001"].attrs["sample_rate_hz"] = "fast"


def bad_trajectory(file):
    file["runs/001"].attrs["trajectory"] = "sine of 15 degrees"


def list_trajectory(file):
    file["runs/001"].attrs["trajectory"] = "[1, 2]"


def replace(file, name, values, unit):
    del file[f"runs/001/{name}"]
    file[f"runs/001/{name}"] = values
    file[f"runs/001/{name}"].attrs["units"] = unit


def mixed_lengths(file):
    replace(file, "mcp_angle", np.zeros(3999), "rad")


def empty_run(file):
    for name in list(file["runs/001"]):
        replace(file, name, np.zeros(0), file[f"runs/001/{name}"].attrs["units"])


def two_dimensional(file):
    replace(file, "mcp_angle", np.zeros((4000, 1)), "rad")


def words_for_numbers(file):
    replace(file, "mcp_angle", np.array([b"open"] * 4000), "rad")


def wrong_units(file):
    file["runs/001/mcp_angle"].attrs["units"] = "deg"


def no_units(file):
    del file["runs/001/motor_torque"].attrs["units"]


def in_every_run(file, channel, index, value):
    """Whichever phase a command looks at, it meets the bad sample."""
    for run in file["runs"].values():
        run[channel][index] = value


def backwards(file):
    in_every_run(file, "time", 2000, 1.0)


def standing(file):
    in_every_run(file, "time", 2001, file["runs/001/time"][2000])


def nan(file):
    in_every_run(file, "mcp_angle", 1500, np.nan)


def infinite(file):
    in_every_run(file, "motor_torque", 1500, np.inf)


BAD_SESSIONS = {
    "missing file": (missing, "does not exist; give the path of a session file"),
    "folder": (folder, "is a folder; give the session file itself"),
    "not HDF5": (not_hdf5, "is not an HDF5 file"),
    "empty file": (empty_file, "is not an HDF5 file"),
    "not a session": (not_a_session, "is HDF5 but not a session; its attribute 'format' should be"),
    "cut off": (cut_off, "it is cut off (copying or recording stopped early)"),
    "damaged": (damaged, "it is damaged"),
    "newer version": (changed(newer), "is of the newer format version 2.1"),
    "strange version": (changed(strange_version), "format_version 'new'; it should be a number"),
    "no runs": (changed(no_runs), "holds no runs"),
    "no group of runs": (changed(no_group), "has no group /runs"),
    "no rig": (changed(no_rig), "lacks the attribute 'rig'"),
    "rig is not JSON": (changed(bad_rig), "attribute 'rig' is not JSON"),
    "rig of words": (changed(rig_of_words), "holds 'gear_ratio' = 'four'; it should be a finite number"),
    "tolerance of words": (changed(rig_tolerance_of_words), "= 'small'; it should be a share"),
    "rig without finger": (
        changed(rig_without_finger),
        "run 001 is 'on_air' but the rig text has no 'finger'",
    ),
    "missing channel": (changed(no_channel), "run 001 lacks the channel 'pip_angle'"),
    "no time": (changed(no_time), "run 001 lacks the channel 'time'"),
    "no phase": (changed(no_phase), "run 001 lacks the attribute 'phase'"),
    "bad phase": (changed(bad_phase), "run 001 has the phase 'in_the_air'; it should be one of on_air"),
    "bad cable": (changed(bad_cable), "run 001 has the cable 'rope'; it should be one of extension"),
    "bad rate": (changed(bad_rate), "run 001 has sample_rate_hz -1.0; it should be a positive number"),
    "rate of words": (changed(rate_of_words), "run 001 has sample_rate_hz 'fast'"),
    "bad trajectory": (changed(bad_trajectory), "run 001 has a trajectory that is not JSON"),
    "trajectory list": (changed(list_trajectory), "run 001 has a trajectory that is not a JSON object"),
    "mixed lengths": (changed(mixed_lengths), "run 001 has 3999 samples of 'mcp_angle' but 4000 of time"),
    "empty run": (changed(empty_run), "run 001 is empty"),
    "two dimensions": (changed(two_dimensional), "a channel should be one-dimensional"),
    "words for numbers": (changed(words_for_numbers), "a channel should be one-dimensional and of numbers"),
    "wrong units": (changed(wrong_units), "channel 'mcp_angle' is in 'deg'; it should be in 'rad'"),
    "no units": (changed(no_units), "channel 'motor_torque' has no attribute 'units'"),
    "time backwards": (changed(backwards), "time runs backwards at sample 2000"),
    "time stands": (changed(standing), "time stands still at sample 2001"),
    "NaN": (changed(nan), "channel 'mcp_angle' holds NaN at sample 1500"),
    "infinity": (changed(infinite), "channel 'motor_torque' holds an infinite number at sample 1500"),
}
