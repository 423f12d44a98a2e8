"""Does this installation work? ``python -m fingerlab.ui.self_check SESSION.h5`` opens the window and sees.

The session is opened as a person opens it, the Model lab compares it with the nominal model, and every tab is
shown once; what drives the card is loaded, too. Ends with 0 and a line of what was seen, or with 1 and the
sentence that the window would show. A packaged program does the same with ``--self-check SESSION.h5``.
"""

from __future__ import annotations

import sys
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSettings, QTimer
from PySide6.QtWidgets import QApplication

from .app.application import prepare
from .app.context import Settings
from .app.window import MainWindow
from .app.worker import Failed

PATIENCE_S = 240
"""After this time a window that has neither compared nor complained counts as stuck."""
LOOK_MS = 50
CARD = "nidaqmx.system"


class SelfCheck:
    """Opens a session in a window of its own settings and ends the application with the outcome.

    Attributes:
        seen: what there is to tell; problem: why the check failed, empty where it did not.
    """

    def __init__(self, app: QApplication, window: MainWindow, session: Path) -> None:
        self.app, self.window, self.session = app, window, session
        self.seen = ""
        self.problem = ""
        self._left = PATIENCE_S * 1000 // LOOK_MS
        window.tasks.failed.connect(self._on_failed)
        self._clock = QTimer(interval=LOOK_MS)
        self._clock.timeout.connect(self._look)

    def begin(self) -> None:
        """Open the session and look at the window from time to time."""
        self.window.open_paths([self.session])
        self._clock.start()

    def _on_failed(self, failed: Failed) -> None:
        self._end(failed.sentence)

    def _look(self) -> None:
        try:
            self._look_once()
        except Exception as error:  # whatever it is, the check has to end with it
            self._end(f"{type(error).__name__}: {error}")

    def _look_once(self) -> None:
        self._left -= 1
        lab: Any = self.window.tab("model_lab") if self.window.current == "model_lab" else None
        diagnosis = lab.controller.diagnosis if lab is not None else None
        if diagnosis is None:
            if self._left <= 0:
                self._end(f"The window showed no comparison of {self.session} within {PATIENCE_S} s.")
            return
        self._clock.stop()
        tabs = self._every_tab()
        self.seen = (
            f"{self.session.name}: {len(diagnosis.candidates)} effects compared, error {diagnosis.score:.2f} "
            f"floors; tabs shown: {', '.join(tabs)}"
        )
        self._end("")

    def _every_tab(self) -> list[str]:
        from .app.tab_registry import TABS

        for entry in TABS:
            self.window.show_tab(entry.key)
            self.app.processEvents()
        return [entry.title for entry in TABS]

    def _end(self, problem: str) -> None:
        self._clock.stop()
        self.problem = problem
        self.window.close()
        self.app.exit(1 if problem else 0)


def main(arguments: list[str]) -> int:
    """Check with the session that ``arguments`` name; returns the exit code."""
    if len(arguments) != 1 or not Path(arguments[0]).is_file():
        print("fingerlab: The self-check needs one session file that exists.", file=sys.stderr)
        return 2
    try:
        import_module(CARD)  # needs no driver; a packaged program may lack a part of it
    except ImportError as error:
        print(f"fingerlab: {CARD}, which drives the card, cannot be loaded ({error}).", file=sys.stderr)
        return 1
    instance = QApplication.instance() or QApplication([sys.argv[0]])
    assert isinstance(instance, QApplication)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        # Its own settings: a check must not change what the user's window remembers.
        store = QSettings(str(Path(folder) / "settings.ini"), QSettings.Format.IniFormat)
        settings = Settings(store)
        prepare(instance, settings)
        window = MainWindow(settings)
        window.show()
        check = SelfCheck(instance, window, Path(arguments[0]))
        QTimer.singleShot(0, check.begin)
        code = instance.exec()
        store.sync()
    print(check.seen or f"fingerlab: {check.problem}", file=sys.stdout if check.seen else sys.stderr)
    return int(code)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
