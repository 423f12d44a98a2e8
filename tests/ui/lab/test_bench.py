"""What was found of the bench itself stands under the verdict, all of it where the pointer rests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.answer.results import BenchFinding

from .. import invented
from ..hands import child, wait_for_result

SAID = (("The zero of the PIP sensor moves", "clamp it"), ("Channel 'mcp_angle' has 9 spikes", "look at it"))
TEXTS = ("The zero of the PIP sensor moves: clamp it.", "Channel 'mcp_angle' has 9 spikes: look at it.")


def test_findings_stand_under_the_verdict(qtbot: QtBot, make_window: Any, session_file: Path) -> None:
    told = tuple(BenchFinding("spikes", "mcp_angle", 9.0, "samples", ("001",), *said) for said in SAID)
    made = make_window(
        diagnose=lambda sessions, *_: replace(invented.unseen_diagnosis(str(sessions[0].path)), bench=told)
    )
    made.context.open_paths([session_file])
    wait_for_result(qtbot, made)
    label = child(made, QLabel, "bench")
    assert label.text() == f"The bench: {TEXTS[0]} And 1 more."
    assert label.toolTip() == "\n".join(TEXTS)
    assert not label.isHidden()
    # No run is in contact: neither button nor menu offers its force.
    (entry,) = [one for one in made.menus.tab_menu.actions() if "Predict the force" in one.text()]
    made.menus.tab_menu.aboutToShow.emit()
    assert not entry.isEnabled()
    assert not child(made, QPushButton, "predictForce").isEnabled()
