"""The window's own small dialogs: the sheet of keys, the log, the question before a user's file is run."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from PySide6.QtCore import Qt, SignalInstance
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QMessageBox, QPlainTextEdit, QTextBrowser, QWidget

from ..widgets.layout import as_written, described, vbox


def ask_to_run(parent: QWidget, path: Path, content: bytes, changed: bool, what: str) -> bool:
    """Whether a file that is new, or was changed, may be run; its text can be looked at.

    Args:
        what: it does, after "It is a program", such as ``it drives the motor, and``.
    """
    box = QMessageBox(parent)
    box.setWindowTitle("FingerLab")
    why = "has changed since you let it be run" if changed else "has not been run yet"
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setText(
        f"{path.name} {why}. It is a program: {what} may do all that you may. Run it now and from now on?"
    )
    box.setInformativeText(as_written(str(path)))
    box.setDetailedText(content.decode("utf-8", errors="replace"))
    run = box.addButton("&Run it", QMessageBox.ButtonRole.AcceptRole)
    leave = box.addButton("&Leave it", QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(leave)
    box.exec()
    return box.clickedButton() is run


KeySheet = Sequence[tuple[str, Sequence[tuple[str, str]]]]

GENERAL_KEYS = (("Cancel what is running", "Ctrl+."), ("From field to field", "Tab, Shift+Tab"))
PLOT_KEYS = (
    ("Zoom in and out", "+  −"),
    ("Move", "←  →"),
    ("Show all", "Home"),
    ("Copy or save it", "Menu, Shift+F10"),
)


def show_keys(sheet: KeySheet, stop_key: str, parent: QWidget) -> QDialog:
    """All keys on one sheet; stays open beside the window."""
    text = described(QTextBrowser(), "keySheet", accessible="Keys")
    general = (("Stop the motor", "Esc"), ("The same, by a foot switch", stop_key), *GENERAL_KEYS)
    rows = []
    for title, entries in (("Everywhere", general), *sheet, ("In a plot", PLOT_KEYS)):
        rows.append(f'<tr><td colspan="2"><b><br>{escape(title)}</b></td></tr>')
        rows += [
            f"<tr><td>{escape(words)}&nbsp;&nbsp;&nbsp;</td><td><b>{escape(key)}</b></td></tr>"
            for words, key in entries
        ]
    text.setHtml(f"<table>{''.join(rows)}</table>")
    return _show("Keys", text, parent)


def show_log(lines: Sequence[str], parent: QWidget, logged: SignalInstance) -> QDialog:
    """What was said since the window opened, latest at the bottom; ``logged`` brings each new line."""
    text = QPlainTextEdit("\n".join(lines))
    text.setPlaceholderText("Nothing has been said yet.")
    text.setAccessibleName("Log")
    text.setObjectName("log")
    text.setReadOnly(True)
    dialog = _show("Log", text, parent)
    logged.connect(text.appendPlainText)  # Qt forgets it with the dialog
    text.verticalScrollBar().setValue(text.verticalScrollBar().maximum())
    buttons = dialog.findChild(QDialogButtonBox)
    assert buttons is not None
    copy = buttons.addButton("&Copy all", QDialogButtonBox.ButtonRole.ActionRole)
    copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(text.toPlainText()))
    return dialog


def _show(title: str, text: QWidget, parent: QWidget) -> QDialog:
    dialog = QDialog(parent)
    dialog.setWindowTitle(f"{title} – FingerLab")
    dialog.resize(520, 560)
    buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
    buttons.rejected.connect(dialog.close)
    vbox(dialog, text, buttons, spacing=8)
    dialog.finished.connect(dialog.deleteLater)
    dialog.show()
    return dialog
