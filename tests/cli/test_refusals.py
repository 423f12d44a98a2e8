"""What a command does not take: one sentence that says what, where, and what would be right."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from fingerlab.core.trust import read_settings

from .calling import assert_one_sentence, call, snapshot

MOVES = '{"kind": "sine", "amplitude_deg": %g, "frequency_hz": 1, "offset_deg": 22, "duration_s": 3}'
SETUP = ("--phase", "on_air", "--cable", "extension")


def refused(folder: Path, *arguments: object, words: tuple[str, ...]) -> None:
    """That it is, and leaves nothing behind."""
    before = snapshot(folder)
    assert_one_sentence(*call(*arguments), *words)
    assert snapshot(folder) == before


def test_one_recording_is_evidence_once(session_file: Path, tmp_path: Path) -> None:
    twice = (f"{session_file} is given twice",)
    refused(tmp_path, "diagnose", session_file, session_file, words=twice)
    refused(tmp_path, "compare", session_file, "--beside", session_file, words=twice)
    page = ("--out", tmp_path / "page.html")
    refused(tmp_path, "report", session_file, session_file, *page, words=twice)
    copy = tmp_path / "copy.h5"
    shutil.copy(session_file, copy)
    refused(tmp_path, "diagnose", session_file, copy, words=(str(copy), "hold the same recording"))


@pytest.mark.parametrize(
    ("command", "options"),
    [("diagnose", ("--save", "--json")), ("fit", ("--model", "--json"))],
)
def test_two_results_have_two_names(
    command: str, options: tuple[str, str], session_file: Path, tmp_path: Path
) -> None:
    place = tmp_path / "x.json"
    both = (options[0], place, options[1], place)
    refused(
        tmp_path, command, session_file, *both, words=(f"{options[0]} and {options[1]} both name {place}",)
    )


@pytest.mark.parametrize("command", [("simulate",), ("record", "--device", "simulated", "--yes")])
@pytest.mark.parametrize(
    ("amplitude", "words"),
    [
        (500.0, ("-478", "522", "-20° to 160°")),
        (0.0, ("'amplitude_deg' = 0",)),
        (-5.0, ("greater than zero",)),
    ],
)
def test_no_run_goes_beyond_the_limits_or_nowhere(
    command: tuple[str, ...], amplitude: float, words: tuple[str, ...], tmp_path: Path
) -> None:
    run = ("--trajectory", MOVES % amplitude, *SETUP, "--out", tmp_path / "s.h5")
    refused(tmp_path, *command, *run, words=words)


def test_a_scan_that_begins_at_nothing_is_refused(tmp_path: Path) -> None:
    table = tmp_path / "scan.csv"
    table.write_text("kind,amplitude_deg,frequency_hz,duration_s\nsine,0 to 10 in 3,1,5\n", encoding="utf-8")
    run = ("simulate", "--protocol", table, "--out", tmp_path / "s.h5")
    refused(tmp_path, *run, words=("row 1", "'amplitude_deg' = 0"))


@pytest.mark.parametrize("name", ["noext", "a.csv"])
def test_a_result_says_what_it_is(name: str, session_file: Path, tmp_path: Path) -> None:
    simulate = ("simulate", "--protocol", "on-air", "--out", tmp_path / name)
    refused(tmp_path, *simulate, words=("--out", "should end in .h5"))
    refused(tmp_path, "report", session_file, "--out", tmp_path / name, words=("--out", ".html"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--protocol", "on-air", "--hidden", "--practice"), ("--hidden and --practice",)),
        (("--protocol", "nope"), ("'nope'", "TABLE.csv")),
        (("--protocol", "on-air", "--seed", "1.5"), ("'--seed'", "'1.5' is not a whole number")),
        (("--trajectory", MOVES % 5, *SETUP, "--effect", "viscous_friction=-1"),
         ("viscous_friction at -1 N m s/rad", "0.0005 to 0.008")),
    ],
)  # fmt: skip
def test_what_simulate_cannot_take_is_named(
    options: tuple[str, ...], words: tuple[str, ...], tmp_path: Path
) -> None:
    refused(tmp_path, "simulate", *options, "--out", tmp_path / "s.h5", words=words)


def test_a_step_that_asks_nothing_cannot_be_answered(tmp_path: Path) -> None:
    answer = ("--answer", "foo=yes", "--out", tmp_path / "check.json")
    refused(tmp_path, "check-rig", "--device", "simulated", *answer, words=("'foo'", "limits/force"))


def test_a_trigger_without_a_unit_is_in_radians(tmp_path: Path) -> None:
    run = ("--trajectory", MOVES % 5, *SETUP, "--out", tmp_path / "s.h5")
    record = ("record", "--device", "simulated", "--yes", *run)
    words = ("motor_position at -573 deg", "-20 to 160 deg", "in rad")
    refused(tmp_path, *record, "--trigger", "motor_position<-10", words=words)


@pytest.mark.parametrize("answers", [(), ("--yes",)])
def test_a_name_that_nobody_knows_is_no_card(
    answers: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("no device 'simulatd'", "'simulated'", "own:FILE.py", "host:31763/Dev1")
    run = ("record", "--device", "simulatd", "--protocol", "on-air", *answers, "--out", tmp_path / "s.h5")
    without_driver(monkeypatch)
    refused(tmp_path, *run, words=words)
    check = ("check-rig", "--device", "simulatd", *answers, "--out", tmp_path / "check.json")
    refused(tmp_path, *check, words=words)


def without_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same on a machine that has one."""
    from nidaqmx import _lib

    def missing(_self: object) -> None:
        raise _lib.DaqNotFoundError(_lib._DAQ_NOT_FOUND_MESSAGE)

    monkeypatch.setattr(_lib.DaqLibImporter, "_import_lib", missing)


def test_a_force_names_what_it_lacks_and_a_pose_its_limits(session_file: Path, tmp_path: Path) -> None:
    model = tmp_path / "model.json"
    assert call("fit", session_file, "--model", model)[0] == 0
    inverse = ("inverse", session_file, "--model", model, "--wanted")
    refused(tmp_path, *inverse, '{"kind": "sine"}', words=("lacks 'amplitude_n'",))
    force = '{"kind": "sine", "mean_n": 1, "amplitude_n": 0.5, "frequency_hz": 0.5}'
    refused(tmp_path, *inverse, force, "--pose", 500, -20, words=("MCP at 500 degrees", "-60 to 95 degrees"))


def test_a_broken_model_says_where_it_breaks(session_file: Path, tmp_path: Path) -> None:
    model = tmp_path / "broken.json"
    model.write_text("{\n", encoding="utf-8")
    where = "it cannot be read from line 2, column 1 on"
    refused(tmp_path, "predict", session_file, "--model", model, words=("broken.json", where))


def test_a_template_changes_no_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it lies is not looked at from then on, unless that is asked for."""
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    code, out, err = call("effects", "--template", tmp_path / "mine.py")
    assert (code, out) == (0, "")
    assert f"'fingerlab effects --folder {tmp_path} --trust mine.py'" in err
    assert read_settings().folder is None
    assert call("effects", "--folder", tmp_path, "--trust", "mine.py", "--json", "-")[0] == 0
    assert read_settings().folder == tmp_path.resolve()
