"""What pages show besides commands: a piece of a rig file, and reading a session with other tools."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from fingerlab.rig.file import Rig, load_rig
from tests.docs.shelf import ROOT

DOCS = ROOT / "docs"


def blocks(page: str, language: str) -> list[str]:
    """The fenced blocks of a page in that language."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert found, page
    return found


def block(page: str, language: str) -> str:
    """The first of them."""
    return blocks(page, language)[0]


def test_the_pieces_of_a_rig_file_go_into_the_default_one(tmp_path: Path) -> None:
    """Each line in the place of the one with its name; the values are then those of the page."""
    shown = tomllib.loads("\n".join(blocks("rig.md", "toml")))
    lines = (ROOT / "resources" / "rigs" / "default.toml").read_text(encoding="utf-8").splitlines()
    section, kept = "", []
    for line in lines:
        head = re.match(r"\[([\w.]+)\]", line)
        name = re.match(r"(\w+) *=", line)
        section = head[1] if head else section
        part = shown
        for word in section.split("."):
            part = part.get(word, {}) if word else part
        if name is None or name[1] not in part:
            kept.append(line)
        if head is not None:
            kept += [f"{key} = {inline(value)}" for key, value in part.items() if not nested(value)]
    for name, part in shown["daq"].items():
        if f"[daq.{name}]" not in lines:  # the default rig has no such line
            kept += [f"[daq.{name}]", *(f"{key} = {inline(value)}" for key, value in part.items())]
    path = tmp_path / "my-rig.toml"
    path.write_text("\n".join(kept) + "\n", encoding="utf-8")
    rig = load_rig(path)
    assert rig.daq.emergency_stop.terminal == shown["daq"]["emergency_stop"]["terminal"]
    assert rig.daq.amplifier_ready.needs_enable
    assert rig.daq.dead_man.hold_time == pytest.approx(0.05)
    assert rig.finger is not None
    assert rig.finger.mcp_stiffness == shown["finger"]["mcp_stiffness"]["value"]
    assert rig.tolerance_of("mcp_stiffness") == shown["finger"]["mcp_stiffness"]["tolerance"]
    assert rig.limits.current == shown["limits"]["current"]["value"]


def nested(value: object) -> bool:
    """A section in a section, such as ``daq.encoder``; a constant with its unit has a value."""
    return isinstance(value, dict) and "value" not in value


def inline(value: object) -> str:
    """A constant as it stands in the file."""
    if not isinstance(value, dict):
        return json.dumps(value)
    return "{ " + ", ".join(f"{key} = {json.dumps(one)}" for key, one in value.items()) + " }"


def test_the_rig_text_of_the_session_file_is_one() -> None:
    rig = Rig.from_json(block("file-format.md", "json"))
    assert rig.finger is not None
    assert rig.finger.wrist_angle == pytest.approx(0.2618)
    assert rig.tolerance_of("inertia") == 0.2


def test_a_session_is_read_with_xarray_as_the_page_says(
    make_session: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_session("session.h5")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(block("file-format.md", "python"), names)
    assert names["run"].mcp_angle.attrs["units"] == "rad"  # type: ignore[attr-defined]
