"""Bad input of every kind to every command: one clear sentence, exit 2, nothing written or overwritten."""

from __future__ import annotations

import errno
import hashlib
import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from fingerlab.cli.main import COMMANDS, main


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
    "tolerance of words": (changed(rig_tolerance_of_words), "use numbers in SI"),
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

COMMAND_LINES = {
    "info": ["info", "{S}", "--json", "out.json"],
    "export": ["export", "{S}", "--to", "csv", "--out", "exported"],
    "fit": ["fit", "{S}", "--json", "out.json"],
    "predict": ["predict", "{S}", "--model", "model.json", "--json", "out.json"],
    "diagnose": ["diagnose", "{S}", "--json", "out.json"],
    "report": ["report", "{S}", "--out", "out.html"],
}


@pytest.fixture(scope="module")
def model_file(tmp_path_factory) -> Path | None:
    """A model that 'fit' made from a simulated session; None while those commands are not there."""
    if any(importlib.util.find_spec(f"fingerlab.cli.{name}") is None for name in ("fit", "simulate")):
        return None
    folder = tmp_path_factory.mktemp("model")
    trajectory = '{"kind": "sine", "amplitude_deg": 15, "frequency_hz": 1, "duration_s": 10}'
    session, model = str(folder / "s.h5"), folder / "model.json"
    options = ["--phase", "on_air", "--cable", "extension", "--seed", "1", "--out", session]
    for arguments in (
        ["simulate", "--trajectory", trajectory, *options],
        ["fit", session, "--model", str(model)],
    ):
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        assert stop.value.code == 0, arguments
    return model


def run_main(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return stop.value.code, captured.out, captured.err


def snapshot(folder: Path) -> dict[str, str]:
    """Every file below a folder with the hash of its content."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
        for path in folder.rglob("*")
    }


def assert_one_sentence(code, out, err, *words):
    assert code == 2, (code, out, err)
    assert out == ""
    assert "Traceback" not in err
    assert len(err.splitlines()) == 1, err
    assert err.startswith("fingerlab: ")
    for word in words:
        assert word in err


@pytest.mark.parametrize("command", COMMAND_LINES)
@pytest.mark.parametrize("case", BAD_SESSIONS)
def test_a_bad_session_is_one_sentence_from_every_command(
    case, command, tmp_path, make_session, model_file, monkeypatch, capsys
):
    module = COMMANDS[command][0].partition(":")[0]
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"the command '{command}' is not there yet")
    make, sentence = BAD_SESSIONS[case]
    path = make(tmp_path / "session.h5", make_session)
    if model_file is not None:
        (tmp_path / "model.json").write_bytes(model_file.read_bytes())
    monkeypatch.chdir(tmp_path)
    before = snapshot(tmp_path)
    code, out, err = run_main([part.replace("{S}", str(path)) for part in COMMAND_LINES[command]], capsys)
    assert_one_sentence(code, out, err, sentence, "session.h5")
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("case", ["missing file", "not HDF5", "NaN", "cut off", "damaged"])
def test_the_same_from_outside(case, tmp_path, make_session):
    """The real program: nothing of HDF5's own chatter reaches the terminal either."""
    make, sentence = BAD_SESSIONS[case]
    path = make(tmp_path / "session.h5", make_session)
    command = [sys.executable, "-c", "from fingerlab.cli import main; main()", "info", str(path)]
    result = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", timeout=60)
    assert_one_sentence(result.returncode, result.stdout, result.stderr, sentence)


ROWS = "\n".join(f"{i / 1000:.3f}\t{i}\t{i}\t0.1\t1\t2\t3" for i in range(50)) + "\n"
HEADER = "time (s)\tcommand (deg)\tposition (deg)\ttorque (Nm)\tMCP (deg)\tPIP (deg)\tforce (N)\n"

BAD_TEXTS = {
    "ragged rows": (ROWS + "0.050\t1\t1\t0.1\t1\n", "line 51 has 5 columns where the first row has 7"),
    "ragged rows below a header": (HEADER + ROWS + "0.050\t1\n", "line 52 has 2 columns"),
    "a word among numbers": (ROWS + "0.050\t1\t1\toff\t1\t2\t3\n", "line 51, column 4 holds 'off'"),
    "no table": ("dear diary\ntoday the finger moved\n", "holds no row of two numbers or more"),
    "empty": ("", "is empty; it should hold a table of numbers"),
    "time backwards": (ROWS + "0.010\t1\t1\t0.1\t1\t2\t3\n", "time runs backwards at sample 50"),
    "NaN": (ROWS + "0.050\t1\t1\t0.1\tnan\t2\t3\n", "channel 'mcp_angle' holds NaN at sample 50"),
    "no header, few columns": ("0\t1\n1\t2\n", "has no header and 2 columns; say which is which with --map"),
    "missing channel": (HEADER.replace("PIP (deg)", "what (deg)") + ROWS, "gives no 'pip_angle'"),
    "wrong units": (HEADER.replace("PIP (deg)", "PIP (N)") + ROWS, "is taken as 'pip_angle' in 'N'"),
}


@pytest.mark.parametrize("case", BAD_TEXTS)
def test_a_bad_text_file_is_one_sentence_below_the_mapping(case, tmp_path, capsys):
    text, sentence = BAD_TEXTS[case]
    good, bad = tmp_path / "good.txt", tmp_path / "bad.txt"
    good.write_text(HEADER + ROWS, encoding="utf-8")
    bad.write_text(text, encoding="utf-8")
    before = snapshot(tmp_path)
    code, out, err = run_main(["import", good, bad, "--out", tmp_path / "s.h5"], capsys)
    said = [line for line in err.splitlines() if line.startswith("fingerlab: ")]
    assert_one_sentence(code, out, "\n".join(said), sentence, "bad.txt")
    assert err.splitlines()[-1] == said[0]
    assert "Traceback" not in err
    assert snapshot(tmp_path) == before


def good_text(tmp_path):
    path = tmp_path / "good.txt"
    path.write_text(HEADER + ROWS, encoding="utf-8")
    return path


def lines_for_writing(tmp_path, make_session, target):
    """The commands of sessions that write, each with its target."""
    return {
        "import": (["import", good_text(tmp_path), "--out", target / "s.h5"], target / "s.h5"),
        "export": (["export", make_session(), "--to", "mat", "--out", target], target / "session.mat"),
        "info --json": (["info", make_session(), "--json", target / "i.json"], target / "i.json"),
    }


@pytest.mark.parametrize("command", ["import", "export", "info --json"])
def test_nothing_is_overwritten(command, tmp_path, make_session, capsys):
    target = tmp_path / "out"
    target.mkdir()
    arguments, place = lines_for_writing(tmp_path, make_session, target)[command]
    place.write_text("precious", encoding="utf-8")
    before = snapshot(tmp_path)
    code, out, err = run_main(arguments, capsys)
    assert_one_sentence(code, out, err, f"{place} exists already and is not overwritten")
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("command", ["import", "export", "info --json"])
def test_a_target_in_a_file_instead_of_a_folder(command, tmp_path, make_session, capsys):
    target = tmp_path / "plain"
    target.write_text("x", encoding="utf-8")
    arguments, _ = lines_for_writing(tmp_path, make_session, target)[command]
    before = snapshot(tmp_path)
    code, out, err = run_main(arguments, capsys)
    assert_one_sentence(code, out, err, "plain")
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("command", ["import", "export"])
@pytest.mark.parametrize(
    ("number", "reason"),
    [(errno.EACCES, "Permission denied"), (errno.EROFS, "Read-only"), (errno.ENOSPC, "No space")],
)
def test_a_read_only_or_full_target(command, number, reason, tmp_path, make_session, monkeypatch, capsys):
    """Permissions do not stop an administrator, so the system's refusal is made here."""
    target = tmp_path / "out"
    target.mkdir()
    arguments, _ = lines_for_writing(tmp_path, make_session, target)[command]
    before = snapshot(tmp_path)
    real = Path.open

    def refuse(self, mode="r", *rest, **options):
        if "x" in mode or "w" in mode:
            raise OSError(number, {errno.EROFS: "Read-only file system"}.get(number, reason), str(self))
        return real(self, mode, *rest, **options)

    monkeypatch.setattr(Path, "open", refuse)
    code, out, err = run_main(arguments, capsys)
    last = err.splitlines()[-1]
    assert_one_sentence(code, out, last, "cannot be written", reason)
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("other.json", '{"software": "SomethingElse", "weights": [1, 2, 3]}'),
        ("broken.json", "{"),
        ("list.json", "[]"),
        ("words.json", "a model"),
        ("empty.json", ""),
    ],
)
def test_a_model_file_of_other_software(name, text, tmp_path, make_session, capsys):
    if importlib.util.find_spec("fingerlab.cli.predict") is None:
        pytest.skip("the command 'predict' is not there yet")
    model = tmp_path / name
    model.write_text(text, encoding="utf-8")
    session = make_session()
    before = snapshot(tmp_path)
    code, out, err = run_main(["predict", session, "--model", model, "--json", tmp_path / "p.json"], capsys)
    assert_one_sentence(code, out, err, name)
    assert snapshot(tmp_path) == before


def test_a_model_that_is_not_there(tmp_path, make_session, capsys):
    if importlib.util.find_spec("fingerlab.cli.predict") is None:
        pytest.skip("the command 'predict' is not there yet")
    code, out, err = run_main(["predict", make_session(), "--model", tmp_path / "none.json"], capsys)
    assert_one_sentence(code, out, err, "none.json")
