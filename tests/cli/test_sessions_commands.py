"""info, import and export as a person types them."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

from fingerlab.cli import sessions as command
from fingerlab.cli.main import COMMANDS
from fingerlab.sessions import open_session
from tests.cli.calling import run_main


def test_info_shows_runs_rig_and_findings(make_session, capsys):
    code, out, err = run_main(["info", make_session()], capsys)
    assert (code, err) == (0, "")
    assert "Ring finger, Łódź" in out
    assert "sine, 15°, 1 Hz" in out
    assert "motor_command, motor_position" in out
    row = next(line for line in out.splitlines() if "mcp stiffness" in line)
    assert "0.12" in row
    assert "± 10 %" in row
    assert "note: run 001: the load cell was not read in 4000 samples." in out
    assert "2 runs, 8.0 s" in out


def test_info_as_json_and_nothing_else(make_session, capsys):
    def lose_samples(file):
        time = file["runs/002/time"][:]
        time[2000:] += 0.010
        file["runs/002/time"][:] = time

    code, out, err = run_main(["info", make_session(change=lose_samples), "--json", "-"], capsys)
    result = json.loads(out)
    assert (code, err) == (0, "")
    assert [run["phase"] for run in result["runs"]] == ["on_air", "contact"]
    assert result["runs"][1]["gaps"] == 1
    assert result["runs"][1]["lost_samples"] == 10
    assert result["runs"][0]["seconds"] == 4.0
    assert result["rig"]["tolerance"] == {"mcp_stiffness": 0.1}
    assert {"level": "warning", "run": "002", "text": "1 gap in time, 10 samples lost."} in result["findings"]


def test_info_runs_on_every_recording_from_outside(shared_data, capsys):
    for path in sorted(shared_data.glob("*.h5")):
        code, out, err = run_main(["info", path], capsys)
        assert (code, err) == (0, ""), path.name
        assert "the file keeps the session format" in out


def test_import_with_and_without_header(tmp_path, shared_data, capsys):
    """The example of the command line's contract, on the bench's own files."""
    files = [shared_data / "text-header.txt", shared_data / "text-decimal-comma.txt"]
    target = tmp_path / "s.h5"
    code, out, err = run_main(
        ["import", *files, "--out", target, "--phase", "contact", "--cable", "flexion"], capsys
    )
    assert code == 0
    assert out.strip() == f"Wrote {target}: 2 runs."
    assert "mcp_angle <- column 5 [deg], times 0.0174533 to rad (header 'MCP (deg)')" in err
    assert "decimal comma, no header" in err
    assert "motor_current <- motor_torque / (torque_constant * gear_ratio) (derived)" in err
    assert "Assumed: the rig's masses" in err
    session = open_session(target)
    assert [(run.phase, run.cable, run.length) for run in session.runs] == [
        ("contact", "flexion", 10_000), ("contact", "flexion", 5_000),
    ]  # fmt: skip
    code, out, _ = run_main(["info", target], capsys)
    assert code == 0


def bench_text(tmp_path, name="a.txt"):
    path = tmp_path / name
    rows = [f"{i / 1000:.3f}\t{i}\t{i}\t0.1\t1\t2\t3" for i in range(100)]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_import_takes_phase_and_cable_for_each_file(tmp_path, capsys):
    files = [bench_text(tmp_path, "a.txt"), bench_text(tmp_path, "b.txt")]
    options = ["--phase", "on_air", "--phase", "contact", "--cable", "extension", "--cable", "flexion"]
    trajectory = ["--trajectory", '{"kind": "sine", "amplitude_deg": 15}', "--title", "two"]
    out_options = ["--out", tmp_path / "s.h5", "--json", "-"]
    code, out, err = run_main(["import", *files, *options, *trajectory, *out_options], capsys)
    assert code == 0
    assert "Assumed: the rig's masses, lengths, springs and pulley (--rig)." in err
    result = json.loads(out)
    assert [(run["phase"], run["cable"]) for run in result["runs"]] == [
        ("on_air", "extension"),
        ("contact", "flexion"),
    ]
    assert result["title"] == "two"
    assert result["runs"][0]["trajectory"]["amplitude_deg"] == 15
    code, _, err = run_main(["import", *files, files[0], *options, "--out", tmp_path / "t.h5"], capsys)
    assert code == 2
    assert "--phase is given 2 times for 3 files" in err


def test_dry_run_writes_nothing(tmp_path, capsys):
    path = bench_text(tmp_path)
    code, out, err = run_main(["import", path, "--out", tmp_path / "s.h5", "--dry-run"], capsys)
    assert (code, out) == (0, "")
    assert "endpoint_force <- column 7" in err
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("answer", "code"), [("y\n", 0), ("n\n", 130)])
def test_on_a_terminal_it_asks_before_it_writes(tmp_path, capsys, monkeypatch, answer, code):
    path = bench_text(tmp_path)

    monkeypatch.setattr(command, "somebody_there", lambda: True)
    monkeypatch.setattr("click.termui.visible_prompt_func", lambda *_: answer.strip())
    found, _, err = run_main(["import", path, "--out", tmp_path / "s.h5"], capsys)
    assert found == code
    assert (tmp_path / "s.h5").exists() == (code == 0)
    assert "time <- column 1" in err


def test_export_says_what_it_wrote(tmp_path, make_session, capsys):
    code, out, err = run_main(
        ["export", make_session(), "--to", "csv", "--out", tmp_path / "o", "--json", "-"], capsys
    )
    assert (code, err) == (0, "")
    names = sorted(path.name for path in (tmp_path / "o").iterdir())
    assert names == ["session-001.csv", "session-002.csv", "session.json"]
    assert len(json.loads(out)["files"]) == 3


def test_help_of_the_group_imports_no_command():
    script = (
        "import sys\nfrom fingerlab.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit as stop:\n    assert stop.code == 0\n"
        "heavy = [m for m in sys.modules if m.startswith('fingerlab.cli.') and m != 'fingerlab.cli.main']\n"
        "assert not heavy, heavy\nassert 'numpy' not in sys.modules and 'h5py' not in sys.modules\n"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    for word, (_, line) in COMMANDS.items():
        assert word in result.stdout
        assert line in " ".join(result.stdout.split())


@pytest.mark.parametrize("word", ["info", "import", "export", "calibrate"])
def test_every_command_has_help(word, capsys):
    code, out, err = run_main([word, "--help"], capsys)
    assert (code, err) == (0, "")
    assert out.startswith(f"Usage: fingerlab {word}")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["frobnicate"], "There is no command and no file 'frobnicate'; the commands are simulate,"),
        (["--frobnicate"], "No such option"),
        (["info"], "Missing argument"),
        (["info", "a.h5", "b.h5"], "unexpected extra argument"),
        (["info", "a.h5", "--colour"], "No such option"),
        (["export", "a.h5", "--to", "xlsx", "--out", "o"], "'xlsx' is not one of"),
        (["export", "a.h5", "--to", "csv"], "Missing option '--out'"),
        (["import", "a.txt"], "The option --out S.h5 is missing"),
        (["import", "a.txt", "--out", "s.h5", "--rate", "-3"], "Invalid value for '--rate'"),
        (["import", "a.txt", "--out", "s.h5", "--trajectory", "sine"], "--trajectory is not JSON"),
    ],
)
def test_bad_usage_is_one_sentence(arguments, sentence, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = run_main(arguments, capsys)
    assert (code, out) == (2, "")
    assert sentence in err
    assert err.startswith("fingerlab: ")
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_numbers_survive_the_way_through_the_commands(tmp_path, make_session, capsys):
    """Export to text, import again: the same numbers, to the last bit."""
    source = make_session()
    run_main(["export", source, "--to", "txt", "--out", tmp_path / "o"], capsys)
    files = [tmp_path / "o" / "session-001.txt", tmp_path / "o" / "session-002.txt"]
    code, _, _ = run_main(["import", *files, "--out", tmp_path / "again.h5"], capsys)
    assert code == 0
    for before, after in zip(
        open_session(source).runs, open_session(tmp_path / "again.h5").runs, strict=True
    ):
        for name, values in before.load().items():
            np.testing.assert_array_equal(after.channel(name), values)
