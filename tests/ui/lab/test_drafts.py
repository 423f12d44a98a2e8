"""Laws are drafted from the Model lab, looked at one by one, and made an own effect."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication, QFileDialog, QLabel, QListWidget
from pytestqt.qtbot import QtBot

from fingerlab.diagnosis.draft.laws import DraftLaw
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.lab.evidence import FingerprintPlot
from fingerlab.ui.lab.own_effects import DraftDialog, EffectEditor, OwnEffects

from ..hands import child, click, invented_diagnosis, lab_of, wait_for_result
from ..looking import cut_off
from .invented_law import invented_law

pytestmark = pytest.mark.qt_log_ignore("This plugin does not support")

LAWS = (invented_law(), invented_law("draft_pip_speed", 5e-4, 1.31))


def test_drafted_looked_at_and_made_an_own_effect(
    qtbot: QtBot,
    make_window: Callable[..., MainWindow],
    session_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    monkeypatch.setenv("FINGERLAB_SETTINGS_DIR", str(tmp_path / "settings"))
    monkeypatch.setattr(
        QFileDialog, "getSaveFileName", staticmethod(lambda *_: (str(folder / "air_drag.py"), ""))
    )
    window = make_window(diagnose=invented_diagnosis)
    window.context.open_paths([session_file])
    wait_for_result(qtbot, window)
    lab = lab_of(window)
    laws: list[tuple[DraftLaw, ...]] = [LAWS, ()]
    monkeypatch.setattr(lab.controller, "_drafted", lambda *_: laws.pop(0))
    command = next(c for c in lab.commands if c.text == "&Draft a law for what is missing…")
    command.call()
    qtbot.waitUntil(lambda: lab.pages.findChild(DraftDialog) is not None)
    dialog = lab.pages.findChild(DraftDialog)
    listed = child(dialog, QListWidget, "draftList")
    assert [listed.item(k).text().split(" by ")[1] for k in range(2)] == [
        "square of motor speed, against it (3.10 to 1.04 floors)",
        "joint speed (3.10 to 1.31 floors)",
    ]
    words = child(dialog, QLabel, "draftWords")
    assert "times square of motor speed" in words.text()
    assert "grows with speed" in words.text()
    assert "the catalogue's best: 1.90 (viscous friction in motor and gearbox)" in words.text()
    assert dialog.findChild(FingerprintPlot).fingerprint is LAWS[0].fingerprint
    listed.setCurrentRow(1)
    assert "torque at the PIP joint" in words.text()
    listed.setCurrentRow(0)
    click(dialog, "draftOwn")
    own = lab.pages.findChild(OwnEffects)
    editor = own.findChild(EffectEditor)
    assert "motion.velocity * np.abs(motion.velocity)" in editor.text.toPlainText()
    assert 'id="air_drag"' in (folder / "air_drag.py").read_text(encoding="utf-8")
    assert own.files.item(0).text() == "air_drag.py: new; not run"
    for window_of_it in (editor, own, dialog):
        window_of_it.close()

    command.call()
    qtbot.waitUntil(
        lambda: any(
            d.words.text().startswith("No law is drafted: the last model leaves 1.00 floors, no more")
            for d in lab.pages.findChildren(DraftDialog)
        )
    )
    again = lab.pages.findChildren(DraftDialog)[-1]
    assert not again.own.isVisible()
    again.close()


def test_buttons_of_own_effects_are_whole_with_larger_letters(larger_letters, qtbot: QtBot) -> None:  # type: ignore[no-untyped-def]
    """ "Forget folder and files" had lost its first letter and its last."""
    dialog = OwnEffects(None, "")
    qtbot.addWidget(dialog)
    dialog.show()
    for _ in range(3):
        QApplication.processEvents()
    assert cut_off(dialog) == []
    assert dialog.forget.width() >= dialog.forget.sizeHint().width()
