"""The worked example prints what its page says, on a session of the real length."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.console import console_lines
from tests.docs.shelf import ROOT, run

PAGE = ROOT / "docs" / "hidden-effect.md"
SAME = 0.25
"""By how much a printed number may differ from that of this machine and version, as a share of it."""


def told(pattern: str, text: str) -> list[float]:
    """The numbers of the first place that fits."""
    found = re.search(pattern, " ".join(text.split()))
    assert found is not None, pattern
    return [float(group) for group in found.groups()]


FACTS = (
    r"falls from ([\d.]+) to ([\d.]+) times the bench's own repeatability",
    r"Joint torque ([\d.]+) ([\d.]+) mN m ([\d.]+)",
    r"friction torque at the gearbox output ([\d.]+) ±",
    r"motor_presliding: torque = ([\d.]+) N m, travel = ([\d.]+) rad",
)
"""Numbers of the page that are looked up in what its commands print."""


def test_the_worked_example_prints_what_its_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text(encoding="utf-8")
    told_of = [c for c in console_lines(page) if not c.reason and c.words[0] != "report"]  # elsewhere
    printed = "\n".join(run(command.words) for command in told_of)
    for fact in FACTS:
        assert told(fact, printed) == pytest.approx(told(fact, page), rel=SAME), fact
    rows = re.findall(
        r"^\| (nominal|with the effect), PIP and MCP \| ([\d.]+) .*?\| ([\d.]+) ±", page, re.MULTILINE
    )
    assert len(rows) == 2
    for name, r2, error in rows:
        word = "nominal" if name == "nominal" else "extended"
        cells = rf"{word} *│ *PIP and MCP *│ *([\d.]+) ±[^│]*│[^│]*│ *([\d.]+) ±"
        shown = re.search(cells, printed)
        assert shown is not None, printed
        assert float(shown[1]) == pytest.approx(float(r2), abs=0.01)
        assert float(shown[2]) == pytest.approx(float(error), rel=SAME)
    assert "Presliding on the motor side is missing" in " ".join(printed.split())
