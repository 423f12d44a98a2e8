"""The story of the thesis' force: its page says what the trials gave, and that is what was asked."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.hidden import thesis_story

PAGE = Path(__file__).resolve().parents[2] / thesis_story.PAGE


def row(seed: int, **more: Any) -> dict[str, Any]:
    model = {"errors": {"joint_torque": [0.004, 0.0003], "endpoint_force": [0.066, 0.006]}, "share": 0.77}
    path = [[None, 36.5], ["cable_stretch", 23.94], ["coulomb_friction", 1.07]]
    about = {"seed": seed, "thesis_share": 0.27, "path": path, "nominal": model, "found": model}
    return {**about, **more}


def test_the_page_is_made_of_the_rows() -> None:
    ratio = {"value": 0.08, "foretold": 0.04}
    trial = {"nominal": {"rms": 0.130}, "found": {"rms": 0.0102}, "ratio": ratio}
    rows = [
        row(2, trial=trial, sentences=["The force error fell."]),
        row(7, failed="The cable would have to push; x"),
    ]
    page = thesis_story.markdown(rows, "made so")
    assert "a peak of **27 %** of the measured one" in page
    assert "| Coulomb joint friction | 1.07 |" in page
    assert "> The force error fell.\n" in page
    assert "| 2 | 27 % | 2 | 36.5 → 1.07 | 130 | 10.2 | 8 % | 4 % |" in page
    assert "| 7 | 27 % | 2 | 36.5 → 1.07 | – | – | – | The cable would have to push |" in page
    assert page.rstrip().endswith("Made by `made so`.")


def test_the_committed_story_is_that_of_a_force_as_wanted() -> None:
    """The thesis' model gave 27 % of the peak; asked was an error of at most 0.3 of the nominal model's."""
    text = PAGE.read_text(encoding="utf-8")
    benches = re.findall(r"^\| \d+ \| (\d+) % \| \d+ \|.*\| (\d+) % \| (\d+) % \|$", text, re.MULTILINE)
    assert len(benches) >= 3
    for share, left, foretold in benches:
        assert float(share) == pytest.approx(27.0, abs=6.0)
        assert float(left) <= 30.0
        assert float(foretold) <= 30.0
