"""``fingerlab report`` as a user calls it, on short recordings of the simulated rig."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fingerlab.core.text import printed
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.session import write_session
from tests.cli.calling import run_command


def move(phase: str, cable: str, amplitude: float, hertz: float, load: float = 0.0, **more: float) -> RunPlan:
    wave = {"kind": "sine", "amplitude_deg": amplitude, "frequency_hz": hertz, "duration_s": 9.0} | more
    return RunPlan(phase, cable, wave, load)


def record(path: Path, plans: list[RunPlan], effect: str) -> Path:
    write_session(path, load_preset("practice"), "short", plans, parse_effects([effect]), seed=5)
    return path


def page_text(path: Path) -> str:
    page = path.read_text(encoding="utf-8")
    root = ElementTree.fromstring(page.removeprefix("<!DOCTYPE html>"))
    return " ".join("".join(root.itertext()).replace("\u00a0", " ").split())


def test_a_recording_of_the_finger_becomes_a_page(tmp_path: Path, capsys) -> None:
    press = load_preset("practice").numbers["protocol"]["contact_amplitude_deg"]
    plans = [
        move("on_air", "extension", 15.0, 1.0, offset_deg=22.0),
        move("on_air", "extension", 11.0, 2.0, offset_deg=22.0),
        move("contact", "flexion", press, 1.0, duration_s=14.0),
    ]
    session = record(tmp_path / "finger.h5", plans, "coulomb_friction")
    out = tmp_path / "finger.html"
    assert run_command("report", session, "--out", out, "--json", "-") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["report"] == str(out)
    assert out.stat().st_size < 3_000_000
    text = page_text(out)
    assert text.count("in contact") >= 1
    best = told["candidates"][0]
    assert f"{told['score']:.2f} times" in text or f"{told['score']:.1f} times" in text
    assert printed(best["explanation"]) in text
    for part in (
        "MCP torque", "PIP torque", "Cable kinematics", "Motor torque", "Endpoint force (PIP equation)",
        "Regression over all runs", "The thesis' numbers", "simulated session, short protocol",
    ):  # fmt: skip
        assert part in text, part
    figures = re.findall(r'aria-label="figure ([\d ]+)', out.read_text(encoding="utf-8"))
    assert [name.strip() for name in figures][:4] == ["4 02", "4 05", "4 03", "4 08"]
    assert set(tmp_path.iterdir()) == {session, out}


def test_a_motor_bench_becomes_a_page_without_a_finger(tmp_path: Path, capsys) -> None:
    plans = [move("motor_bench", "none", 60.0, 0.5, load, offset_deg=70.0) for load in (0.0, 0.05, 0.09)]
    session = record(tmp_path / "bench.h5", plans, "motor_viscous_friction")
    out, pdf, drawn = tmp_path / "bench.html", tmp_path / "bench.pdf", tmp_path / "figures"
    equation = tmp_path / "bench.tex"
    more = ("--pdf", pdf, "--figures", drawn, "--equation", equation)
    assert run_command("report", session, "--out", out, *more) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert str(out) in captured.err
    assert pdf.read_bytes()[:5] == b"%PDF-"
    assert len(list(drawn.iterdir())) % 3 == 0
    assert r"\ddot\theta_m" in equation.read_text(encoding="utf-8")
    text = page_text(out)
    for part in ("The motor-bench equation", "Inertia J", "Gain on the load", "3 motor bench"):
        assert part in text, part
    for part in ("Endpoint force", "Regression over all runs", "MCP torque"):
        assert part not in text, part


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{missing}", "--out", "{out}"], "no-such.h5"),
        (["{text}", "--out", "{out}"], "is not an HDF5 file"),
        (["{session}"], "--out"),
        (["{session}", "--out", "{out}", "--add", "gremlins"], "no effect 'gremlins'"),
        (["{session}", "--out", "{text}"], "not overwritten"),
        (["{session}", "--out", "{folder}/no/R.html"], "does not exist"),
        (["{session}", "--out", "{out}", "--json", "{text}"], "not overwritten"),
        (["{session}", "--out", "{out}", "--json", "{out}"], "a name of its own"),
        (["{session}", "--out", "{out}", "--pdf", "{folder}/r.txt"], "ends with .pdf"),
        (["{session}", "--out", "{out}", "--equation", "{folder}/e.txt"], "neither .md"),
        (["{session}", "--out", "{out}", "--figures", "{text}"], "is a file"),
    ],
)
def test_bad_calls_are_one_sentence_and_write_nothing(
    arguments, words, make_session, tmp_path, capsys
) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("mine", encoding="utf-8")
    places = {
        "missing": tmp_path / "no-such.h5", "text": text, "session": make_session(), "folder": tmp_path,
        "out": tmp_path / "R.html",
    }  # fmt: skip
    before = set(tmp_path.iterdir())
    assert run_command("report", *(a.format(**places) for a in arguments)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.strip().splitlines()) == 1
    assert words in captured.err
    assert set(tmp_path.iterdir()) == before
    assert text.read_text(encoding="utf-8") == "mine"
