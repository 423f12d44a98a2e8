"""Bad input of every kind to every command: one clear sentence, exit 2, nothing written or overwritten."""

from __future__ import annotations

import errno
import importlib.util
import subprocess
import sys
from pathlib import Path

import click
import pytest

from fingerlab.cli.common import write_json
from fingerlab.cli.main import COMMANDS, cli, main
from fingerlab.core.errors import UserError
from tests.cli.bad_sessions import BAD_SESSIONS
from tests.cli.calling import assert_one_sentence, run_main, snapshot

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
    "ragged rows": (
        ROWS + 2 * "0.050\t1\t1\t0.1\t1\n" + "0.05",
        "line 51 has 5 columns where the first row has 7",
    ),
    "ragged rows below a header": (HEADER + ROWS + 3 * "0.050\t1\n", "line 52 has 2 columns"),
    "a word among numbers": (2 * "0.050\t1\t1\toff\t1\t2\t3\n" + ROWS, "line 1, column 4 holds 'off'"),
    "no table": ("dear diary\ntoday the finger moved\n", "holds no row of two numbers or more"),
    "empty": ("", "is empty; it should hold a table of numbers"),
    "time backwards": (ROWS + "0.010\t1\t1\t0.1\t1\t2\t3\n", "time runs backwards at sample 50"),
    "NaN": (ROWS + 2 * "0.050\t1\t1\t0.1\tnan\t2\t3\n", "line 51, column 5 holds nan; it should be a number"),
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


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_writes_its_json_over_a_file(command: str, tmp_path: Path) -> None:
    kept = tmp_path / "kept.json"
    kept.write_text("{}", encoding="utf-8")
    found = cli.get_command(click.Context(cli), command)
    assert found is not None
    assert "json_target" in {parameter.name for parameter in found.params}
    with pytest.raises(UserError, match="not overwritten"):
        found.make_context(command, ["--json", str(kept)])
    with pytest.raises(UserError, match="not overwritten"):  # nor where it came about meanwhile
        write_json({"new": 1}, str(kept))
    assert [path.name for path in tmp_path.iterdir()] == ["kept.json"]
    assert kept.read_text(encoding="utf-8") == "{}"
