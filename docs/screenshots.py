"""Makes the pictures in ``docs/images`` from the running program.

Every tab in every state that matters, light and dark, at 1280 x 800 and 1920 x 1080. The rig is the simulated
one on a virtual clock; the other tabs show sessions that are recorded from it first::

    python docs/screenshots.py            # into docs/images
    python docs/screenshots.py FOLDER     # elsewhere, to look first
    python docs/screenshots.py FOLDER acquire   # only one tab

Numbers that the tutorials tell beside a picture are read from the same window and kept in ``facts.toml``
beside the pictures; a test compares the tutorials with it. In the large size only the main state is kept.

Runs without a display (Qt's off-screen platform).
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
import tomllib
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PIL import Image
from PySide6.QtCore import QBuffer, QSettings
from PySide6.QtWidgets import QApplication, QDialog
from screenshot_states import FACTS, TABS, States, pause

from fingerlab.ui.app import application
from fingerlab.ui.app.application import Tidier
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.theme import apply_appearance

SIZES = ((1280, 800), (1920, 1080))
LOOKS = ("light", "dark")
MAIN_STATES = ("running", "hold", "result", "review", "")
"""States that are kept in every size; the others in the smallest alone."""
COLOURS, EXACT = 256, 192
"""Of a picture's palette, and how many of them are the most frequent ones as they are: a window has few
colours, and a file with a palette is a third of one without."""


def main() -> None:
    """Make all pictures, or those of the tabs that are named."""
    given = sys.argv[1:]
    if any(word.startswith("-") for word in given):
        raise SystemExit(__doc__)
    target = (Path(given[0]) if given else Path(__file__).parent / "images").resolve()
    target.mkdir(parents=True, exist_ok=True)
    wanted = given[1:] or list(TABS)
    app = QApplication([])
    tidier = Tidier(app)
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        try:
            for name in wanted:
                own = Path(folder) / name
                own.mkdir()
                os.chdir(own)  # a window shows "recordings" and not where this machine keeps such folders
                take(app, name, TABS[name], target, own)
                keep_facts(target / "facts.toml")
        finally:
            os.chdir(home)
            tidier.end()


def keep_facts(path: Path) -> None:
    """Write what the window said; what was there of other tabs stays."""
    told = {name.split(".")[0] for name in FACTS}
    old = tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    old = {name: value for name, value in old.items() if name.split(".")[0] not in told}
    lines = [f'"{name}" = "{value}"' for name, value in sorted({**old, **FACTS}.items())]
    text = "# Made by docs/screenshots.py: what the window says in the pictures.\n" + "\n".join(lines) + "\n"
    path.write_text(text, encoding="utf-8")


def take(app: QApplication, tab: str, states: States, target: Path, folder: Path) -> None:
    """All states of one tab: in each, light and dark in every size."""
    settings = Settings(QSettings(f"{folder}/{tab}.ini", QSettings.Format.IniFormat))
    settings.set_recordings(Path("recordings"))
    settings.set_tab(tab.removesuffix("_practice"))
    application.prepare(app, settings)
    window = MainWindow(settings)
    window.resize(*SIZES[0])
    window.show()
    for state in states(window, folder):
        pause(50)  # a window that has just opened takes the focus only now
        if window.rail.focusWidget() is not None:
            window.rail.focusWidget().clearFocus()
        for look in LOOKS:
            apply_appearance(app, look)  # type: ignore[arg-type]
            for size in SIZES:
                window.resize(*size)
                pause(150)
                dark, wide = ["dark"] if look == "dark" else [], [str(size[0])] if size != SIZES[0] else []
                name = "-".join([tab.replace("_", "-"), *([state] if state else []), *dark, *wide])
                if size == SIZES[0] or state in MAIN_STATES:
                    save(window, target / f"{name}.png")
        window.resize(*SIZES[0])
    application.let_go(window)


def save(window: MainWindow, path: Path) -> None:
    """The window, or the dialog that stands open over it, as a PNG with a palette of its own colours."""
    shown = [dialog for dialog in window.findChildren(QDialog) if dialog.isVisible()]
    buffer = QBuffer()
    buffer.open(QBuffer.OpenModeFlag.ReadWrite)
    (shown[-1] if shown else window).grab().save(buffer, "PNG")
    picture = Image.open(io.BytesIO(bytes(buffer.data().data()))).convert("RGB")
    most = sorted(picture.getcolors(picture.width * picture.height), reverse=True)[:EXACT]
    rest = picture.quantize(
        COLOURS - EXACT, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
    ).getpalette()
    palette = Image.new("P", (1, 1))
    palette.putpalette([*(part for _, colour in most for part in colour), *(rest or [])])
    picture.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
