"""Blind trials: the simulated bench seals what it has, the diagnosis sees the file alone, then it is opened.

Only the commands and the files between them are used, as a stranger would.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from fingerlab.cli.main import cli
from fingerlab.diagnosis import diagnose
from fingerlab.sessions import open_session


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


def test_both_sheaths_take_what_was_put_in(tmp_path: Path) -> None:
    """The same wrap for either cable. From a travel that was too short the palmar share came down to 0.14.

    What slides sooner seems to take less, and what takes less slides sooner.
    """
    path, wrap = tmp_path / "sheath.h5", 0.2527
    effect = f"capstan_friction={wrap}"
    run("simulate", "--protocol", "thesis", "--effect", effect, "--seed", "3", "--out", path)
    answer = diagnose([open_session(path)], ["capstan_friction"], with_curves=False)
    for cable in ("extension", "flexion"):
        found = answer.parameters[f"capstan_friction.{cable}"].value
        assert found == pytest.approx(1.0 - math.exp(-wrap), rel=0.15)


@pytest.mark.parametrize(
    ("effects", "seed", "one_by_one"),
    [
        (("added_mass=x1.1", "cable_slack=x1.2"), 3276, True),
        (("motor_spring=x1.3", "cable_slack=x1.2"), 12, False),
    ],
)
def test_two_effects_that_hide_each_other_are_both_found(
    effects: tuple[str, str], seed: int, one_by_one: bool, tmp_path: Path
) -> None:
    """The cable hangs loose in nearly all of the free flexion, or a spring of the motor passes for tension.

    The sweep of pairs has a hundred others.
    """
    path = tmp_path / "two.h5"
    asked = [word for one in effects for word in ("--effect", one)]
    run("simulate", "--protocol", "rich", *asked, "--seed", str(seed), "--out", path)
    answer = run("diagnose", path)
    truth = {one.split("=")[0] for one in effects}
    assert answer["verdict"] == "missing_effect"
    assert {step["added"] for step in answer["path"]} - {None} == truth
    assert answer["path"][-1]["score"] < 0.5 * answer["score"]
    if not one_by_one:
        return
    first = answer["path"][1]["added"]
    then = run("diagnose", path, "--add", first)
    assert {then["candidates"][0]["effect"]} == truth - {first}
    assert then["path"][-1]["score"] == pytest.approx(answer["path"][-1]["score"], abs=0.05)


def test_one_run_does_not_tell_a_law_with_gains_to_spare(tmp_path: Path) -> None:
    """A sine on air. On its grid Stribeck's law took up what only the travel of Coulomb's lacked: 93 %."""
    path = tmp_path / "coulomb.h5"
    effect = "coulomb_friction=x1.2"
    run("simulate", "--protocol", "rich", "--effect", effect, "--seed", "77", "--out", path)
    session = open_session(path)
    single = replace(session, runs=tuple(one for one in session.runs if one.name == "003"))
    found = diagnose([single], with_curves=False)
    assert found.candidates[0].effect == "coulomb_friction"
    assert found.final_model == ("coulomb_friction",)
    given = diagnose([single], found.final_model, with_curves=False)
    assert given.better is None
    assert given.verdict == "nothing_missing"


def test_a_wrong_effect_that_was_added_is_offered_for_the_right_one(tmp_path: Path) -> None:
    path = tmp_path / "stribeck.h5"
    run("simulate", "--protocol", "rich", "--effect", "stribeck_friction", "--seed", "31", "--out", path)
    answer = run("diagnose", path, "--add", "coulomb_friction")
    better = answer["better_model"]
    assert answer["verdict"] == "missing_effect"
    assert (better["remove"], better["add"]) == (["coulomb_friction"], ["stribeck_friction"])
    assert better["score"] < answer["score"]
    assert answer["path"][1]["removed"] == "coulomb_friction"
    assert answer["final_model"] == ["stribeck_friction"]
    assert answer["set"][0] == answer["candidates"][0]["effect"] == "stribeck_friction"
