"""``fingerlab effects``: the catalogue as a list, and the way of a user's own file into it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from fingerlab.cli.main import LazyGroup, cli
from fingerlab.effects import CATALOGUE

EXAMPLE = Path(__file__).parents[2] / "docs" / "own_effect_example.py"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    made = tmp_path / "mine"
    made.mkdir()
    shutil.copy(EXAMPLE, made)
    return made


def call(*arguments: object, answer: str = "") -> Result:
    return CliRunner().invoke(cli, [str(a) for a in arguments], input=answer)


def test_the_list_names_every_effect_with_its_ranges_and_sources(folder: Path) -> None:
    told = call("effects")
    assert told.exit_code == 0
    assert isinstance(cli, LazyGroup)
    for name, effect in CATALOGUE.items():
        assert f"{name}  {effect.title}" in told.stdout
    assert "KMA210 data sheet" in told.stdout
    assert "(assumed)" in told.stdout
    assert "MCP friction torque: 0 to 50 mN m" in told.stdout
    assert f"{len(CATALOGUE)} effects, 0 of them your own." in told.stdout


def test_an_own_file_goes_from_waiting_to_the_list(folder: Path) -> None:
    chosen = call("effects", "--folder", folder, "--json", "-")
    assert "waits for 'fingerlab effects --trust own_effect_example.py'" in chosen.stderr
    data = json.loads(chosen.stdout)
    assert data["folder"] == str(folder.resolve())
    assert [f["state"] for f in data["own_files"]] == ["waiting"]
    assert {e["id"] for e in data["effects"]} == set(CATALOGUE)

    trusted = call("effects", "--trust", folder / EXAMPLE.name)
    assert trusted.exit_code == 0
    assert "it adds motor_root_friction" in trusted.stderr
    data = json.loads(call("effects", "--json", "-").stdout)
    (own,) = [e for e in data["effects"] if e["own"]]
    assert (own["id"], own["equations"]) == ("motor_root_friction", ["motor_torque"])
    assert own["file"] == str(folder.resolve() / EXAMPLE.name)
    assert own["parameters"]["root"] == {
        "unit": "N m (s/rad)^0.5", "low": 0.0, "high": 0.05, "typical": 0.003, "source": "assumed",
        "title": "friction coefficient",
    }  # fmt: skip
    assert "your own, from" in call("effects").stdout

    taken_back = call("effects", "--untrust", EXAMPLE.name, "--json", "-")
    assert [f["state"] for f in json.loads(taken_back.stdout)["own_files"]] == ["waiting"]
    assert "never confirmed" in str(call("effects", "--untrust", EXAMPLE.name).exception)

    assert call("effects", "--forget").exit_code == 0
    assert json.loads(call("effects", "--json", "-").stdout)["folder"] is None


@pytest.mark.parametrize(("answer", "state"), [("n\n", "waiting"), ("\n", "waiting"), ("y\n", "trusted")])
def test_on_a_terminal_the_file_is_shown_and_asked_for(
    folder: Path, monkeypatch: pytest.MonkeyPatch, answer: str, state: str
) -> None:
    monkeypatch.setattr("fingerlab.cli.effects.somebody_there", lambda: True)
    asked = call("effects", "--folder", folder, answer=answer)
    assert asked.exit_code == 0, asked.output
    assert "np.sqrt(np.abs(motion.velocity))" in asked.stderr
    assert "Run it now and from now on? [y/N]" in asked.stderr
    data = json.loads(call("effects", "--json", "-").stdout)
    assert [f["state"] for f in data["own_files"]] == [state]


def test_diagnose_says_that_a_file_waits(folder: Path, make_session) -> None:
    call("effects", "--folder", folder)
    told = call("diagnose", make_session(phases=(("on_air", "extension"),), samples=6000))
    assert "waits for 'fingerlab effects --trust own_effect_example.py'" in told.stderr
    unknown = call("diagnose", make_session("b.h5"), "--add", "motor_root_friction")
    assert "There is no effect 'motor_root_friction'" in str(unknown.exception)
    assert "fingerlab effects --trust" in str(unknown.exception)


def test_a_file_that_does_not_work_is_refused_with_its_line(folder: Path) -> None:
    call("effects", "--folder", folder)
    (folder / "bad.py").write_text("import numpy\nnumpy.nothing_like_this\n", encoding="utf-8")
    refused = call("effects", "--trust", "bad.py")
    assert refused.exit_code != 0
    assert "bad.py, line 2: AttributeError" in str(refused.exception)
    assert "not a Python file in" in str(call("effects", "--trust", "none.py").exception)
