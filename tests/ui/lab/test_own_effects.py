"""Own effects in the window: a folder is chosen, a file let in after a question, and that taken back."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog, QLabel
from pytestqt.qtbot import QtBot

from fingerlab.effects import whole_catalogue
from fingerlab.ui.lab.own_effects import EMPTY_FOLDER, NO_FOLDER, OwnEffects

from ..hands import child, click, lab_of

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "own_effect_example.py"
ADDS = "motor_root_friction"


def test_a_file_is_let_in_once_and_forgotten(  # type: ignore[no-untyped-def]
    qtbot: QtBot, make_window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []
    answers = [False, True, True]

    def ask(parent: object, path: Path, content: bytes, changed: bool, what: str) -> bool:
        assert content == path.read_bytes()  # what is shown is what is run
        asked.append(changed)
        return answers.pop(0)

    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    monkeypatch.setattr("fingerlab.ui.lab.own_effects.ask_to_run", ask)
    folder = tmp_path / "mine"
    folder.mkdir()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", staticmethod(lambda *_: str(folder)))
    window = make_window()
    lab = lab_of(window)
    next(c for c in lab.commands if c.text == "&Own effects…").call()
    dialog = lab.pages.findChild(OwnEffects)
    assert dialog is not None
    place = child(dialog, QLabel, "ownFolder")
    assert place.text() == NO_FOLDER
    click(dialog, "ownFolderChoose")
    assert EMPTY_FOLDER in place.text()

    file = Path(shutil.copy(EXAMPLE, folder))
    click(dialog, "ownFolderChoose")
    click(dialog, "ownTrust")  # and the answer is no
    assert dialog.files.item(0).text() == f"{EXAMPLE.name}: new; not run"
    assert ADDS not in whole_catalogue()
    click(dialog, "ownTrust")
    assert "takes part, as" in dialog.files.item(0).text()
    assert ADDS in whole_catalogue()
    assert not dialog.trust.isEnabled()

    file.write_text("import nowhere_at_all\n", encoding="utf-8")
    click(dialog, "ownFolderChoose")
    assert "changed since you let it run" in dialog.files.item(0).text()
    click(dialog, "ownTrust")
    assert "does not work" in dialog.files.item(0).text()
    assert "ModuleNotFoundError" in dialog.files.item(0).text()
    assert asked == [False, False, True]

    click(dialog, "ownUntrust")
    assert dialog.files.item(0).text() == f"{EXAMPLE.name}: new; not run"
    click(dialog, "ownForget")
    assert place.text() == NO_FOLDER
    assert dialog.files.count() == 0
    assert not dialog.forget.isEnabled()
    dialog.close()
