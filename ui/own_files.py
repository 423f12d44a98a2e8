"""The question before a Python file of the user's own is run."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QMessageBox, QWidget


def ask_to_run(parent: QWidget, path: Path, content: bytes, changed: bool, what: str) -> bool:
    """Whether a file that is new, or was changed, may be run; its text can be looked at.

    Args:
        what: it does, after "It is a program", such as ``it drives the motor, and``.
    """
    box = QMessageBox(parent)
    box.setWindowTitle("FingerLab")
    why = "has changed since you let it be run" if changed else "has not been run yet"
    box.setText(
        f"{path.name} {why}. It is a program: {what} may do all that you may. Run it now and from now on?"
    )
    box.setInformativeText(str(path))
    box.setDetailedText(content.decode("utf-8", errors="replace"))
    run = box.addButton("&Run it", QMessageBox.ButtonRole.AcceptRole)
    leave = box.addButton("&Leave it", QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(leave)
    box.exec()
    return box.clickedButton() is run
