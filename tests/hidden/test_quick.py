"""Blind trials: the simulated bench seals what it has, the diagnosis sees the file alone, then it is opened.

Only the commands and the files between them are used, as a stranger would.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from fingerlab.cli.main import cli


def run(*arguments: str | Path) -> dict[str, Any]:
    result = CliRunner().invoke(cli, [*map(str, arguments), "--json", "-"])
    assert result.exit_code == 0, result.output
    answer: dict[str, Any] = json.loads(result.stdout)
    return answer


@pytest.mark.parametrize(("seed", "holds_one"), [(6, False), (8, True)])
def test_sealed_session_is_diagnosed_before_it_is_opened(seed: int, holds_one: bool, tmp_path: Path) -> None:
    path = tmp_path / "sealed.h5"
    told = run("simulate", "--protocol", "rich", "--hidden", "--seed", str(seed), "--out", path)
    assert told["sealed"]
    assert told["effects"] is None
    answer = run("diagnose", path)
    truth = set(run("reveal", path)["effects"])
    assert bool(truth) == holds_one  # both kinds, so that neither verdict passes by default
    if truth:
        assert answer["verdict"] == "missing_effect"
        assert truth <= set(answer["set"])
        assert answer["candidates"][0]["effect"] in truth
        assert len(answer["set"]) <= 3
    else:
        assert answer["verdict"] == "nothing_missing"
