"""The goldens' own command: what is equal it calls equal, and it sees the last bit of a number."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.goldens.__main__ import main
from tests.goldens.comparing import differences
from tests.goldens.items import recordings, sweep
from tests.goldens.report import page

NAME = "motor-bench-motor_coulomb_friction-501"


def ask(command: str, folder: Path, *more: str, steps: Sequence[str] = ("diagnose", "sums")) -> Result:
    words = ["--part", "quick", "--only", NAME, *(word for step in steps for word in ("--step", step))]
    return CliRunner().invoke(main, [command, str(folder), *words, *more])


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("goldens")
    done = ask("store", folder)
    assert done.exit_code == 0, done.output
    assert "1 stored, 0 failed" in done.output
    return folder


def test_the_same_code_gives_the_same_bits_in_another_process(stored: Path) -> None:
    done = ask("compare", stored, "--made-anew")
    assert done.exit_code == 0, done.output
    assert "1 compared: 1 equal, 0 differ, 0 not stored." in done.output


def test_what_is_stored_is_not_taken_again(stored: Path) -> None:
    before = (stored / f"{NAME}.json").read_bytes()
    assert "0 stored, 0 failed" in ask("store", stored).output
    assert (stored / f"{NAME}.json").read_bytes() == before


def test_a_number_that_differs_in_its_last_bit_is_told(stored: Path) -> None:
    path = stored / f"{NAME}.json"
    text = path.read_text(encoding="utf-8")
    golden = json.loads(text)
    fit = golden["steps"]["sums"]["fit"]
    fit["cost"] = math.nextafter(fit["cost"], math.inf)
    path.write_text(json.dumps(golden), encoding="utf-8")
    try:
        done = ask("compare", stored, steps=["sums"])
        passed = ask("compare", stored, "--tolerance", "1e-12", steps=["sums"])
        passed_over = ask("compare", stored, "--but-for", "sums.fit.co*", steps=["sums"])
    finally:
        path.write_text(text, encoding="utf-8")
    assert done.exit_code == 1
    assert "1 value differs" in done.output
    assert f"sums.fit.cost: {fit['cost']!r} -> " in done.output
    assert "1 compared: 0 equal, 1 differ" in done.output
    assert passed.exit_code == passed_over.exit_code == 0


def test_another_session_under_the_same_name_is_told(stored: Path) -> None:
    path = stored / f"{NAME}.json"
    text = path.read_text(encoding="utf-8")
    golden = json.loads(text)
    golden["content"][f"{NAME}.h5"]["runs"]["003"] = "0"
    path.write_text(json.dumps(golden), encoding="utf-8")
    try:
        done = ask("compare", stored, "--made-anew", steps=["sums"])
    finally:
        path.write_text(text, encoding="utf-8")
    assert done.exit_code == 1
    assert f"session file.{NAME}.h5.runs.003: '0' -> " in done.output
    assert f"session made anew.{NAME}.h5.runs.003: '0' -> " in done.output


def test_what_was_never_stored_is_no_agreement(tmp_path: Path) -> None:
    done = ask("compare", tmp_path)
    assert done.exit_code == 1
    assert "0 compared: 0 equal, 0 differ, 1 not stored." in done.output


def test_values_are_compared_by_their_bits() -> None:
    places = [d.place for d in differences({"a": 0.0, "b": 1, "c": [1.0]}, {"a": -0.0, "b": 1.0, "d": 2})]
    assert places == ["a", "b", "c", "d"]
    assert differences([math.nan, math.inf, 0.1 + 0.2], [math.nan, math.inf, 0.30000000000000004]) == []
    (one,) = differences([2.0], [2.0 + 2e-9], tolerance=1e-10)
    assert one.relative == pytest.approx(1e-9)
    assert differences([2.0, 0.0], [2.0 + 2e-9, -0.0], tolerance=1e-8) == []


def test_a_page_is_what_it_says_and_draws() -> None:
    html = (
        "<p>Written by FingerLab 0.1.0 on 2026-11-22T17:43:41+00:00; the diagnosis took 1.8 s.</p>\n"
        '<svg id="f1"><path d="M 1 2"/><text x="1">floor</text></svg><b>6.74</b>'
    )
    told = page(html, Path("folder"))
    later = html.replace("22T17:43", "23T08:00").replace("1.8 s", "12.1 s").replace("0.1.0", "0.2.0")
    assert page(later, Path("folder")) == told
    assert told["figures"]["f1"]["words"] == ["floor"]
    for change in (("6.74", "6.75"), ("M 1 2", "M 1 3"), ("floor", "roof"), ('x="1"', 'x="2"')):
        assert page(html.replace(*change), Path("folder")) != told, change


def test_the_sessions_are_of_all_kinds_and_the_quick_part_is_among_them(tmp_path: Path) -> None:
    items = [*sweep(), *recordings(tmp_path)]
    names = [item.name for item in items]
    assert len(set(names)) == len(names)
    assert 290 <= len(items) <= 310
    kinds = {item.kind for item in items}
    assert {"rich", "thesis", "pairs", "outside", "engine", "proposed", "motor-bench"} < kinds
    assert {item.kind for item in items if item.quick} == kinds
    assert all(set(item.quick) <= set(item.steps) for item in items)
