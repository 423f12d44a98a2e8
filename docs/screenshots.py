"""Makes the pictures in ``docs/images`` from the running program.

Every tab in every state that matters, light and dark. The rig is the simulated one on a virtual clock; the
other tabs show sessions that are recorded from it first::

    python docs/screenshots.py            # into docs/images
    python docs/screenshots.py FOLDER     # elsewhere, to look first
    python docs/screenshots.py FOLDER acquire   # only one tab

Most states are kept at 1280 x 800 alone. A state that stands for a point of the window (``POINTS``) is kept
in the folder ``points`` in both themes at 1280 x 800, at 1920 x 1080 and at twice the scale, as the screen
shows it: a dialog or menu over the window; beside the others it is light alone. Twice the scale is a process
of its own, which this one starts.

Numbers that the tutorials tell beside a picture are read from the same window and kept in ``facts.toml``
beside the pictures; a test compares the tutorials with it.

Runs without a display (Qt's off-screen platform).
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import numpy as np
from PIL import Image
from PySide6.QtCore import QBuffer, QRect, QSettings
from PySide6.QtGui import QPainter, QPalette, QPen, QPixmap
from PySide6.QtWidgets import QApplication, QDialog, QMenu, QWidget
from screenshot_points import ELSEWHERE, POINTS, walk_states
from screenshot_states import FACTS, TABS, States, pause

from fingerlab.ui.app import application
from fingerlab.ui.app.application import Tidier
from fingerlab.ui.app.context import Settings
from fingerlab.ui.app.window import MainWindow
from fingerlab.ui.widgets.theme import apply_appearance

SIZES = ((1280, 800), (1920, 1080))
LOOKS = ("light", "dark")
STATES = {**TABS, "walk": walk_states}
SCALE = "QT_SCALE_FACTOR"
TWOFOLD = os.environ.get(SCALE) == "2"
"""Whether this is the process that takes the pictures at twice the scale."""
COLOURS, FEW = 256, 32
"""Of a picture's palette, and of one of the points, of which there are many: a window has few colours, and a
file with a palette is a third of one without."""


def main() -> None:
    """Make all pictures, or those of the tabs that are named."""
    given = sys.argv[1:]
    if any(word.startswith("-") for word in given):
        raise SystemExit(__doc__)
    target = (Path(given[0]) if given else Path(__file__).parent / "images").resolve()
    target.mkdir(parents=True, exist_ok=True)
    wanted = given[1:] or list(STATES)
    if TWOFOLD:
        kept = (*POINTS, *(key for key, sizes in ELSEWHERE.items() if any("2x" in size for size in sizes)))
        wanted = [name for name in wanted if any(key.startswith(name.replace("_", "-")) for key in kept)]
    app = QApplication([])
    tidier = Tidier(app)
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        try:
            for name in wanted:
                own = Path(folder) / name
                own.mkdir()
                os.chdir(own)  # a window shows "recordings" and not where this machine keeps such folders
                take(app, name, STATES[name], target, own)
                if not TWOFOLD:
                    keep_facts(target / "facts.toml")
        finally:
            os.chdir(home)
            tidier.end()
    if not TWOFOLD:
        again = [sys.executable, __file__, str(target), *wanted]
        subprocess.run(again, env={**os.environ, SCALE: "2"}, check=True)


def keep_facts(path: Path) -> None:
    """Write what the window said; what was there of other tabs stays."""
    tabs = {name.split(".")[0] for name in FACTS}
    old = tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    old = {name: value for name, value in old.items() if name.split(".")[0] not in tabs}
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
        key = "-".join([tab.replace("_", "-"), *([state] if state else [])])
        for look in LOOKS:
            apply_appearance(app, look)  # type: ignore[arg-type]
            for size in SIZES[:1] if TWOFOLD else SIZES:
                window.resize(*size)
                pause(150)
                width = "2x" if TWOFOLD else str(size[0])
                size_words = "-".join((["dark"] if look == "dark" else []) + [width])
                if width == str(SIZES[0][0]) and not (look == "dark" and key in POINTS):
                    save(grabbed(window), target / f"{key}{'-dark' if look == 'dark' else ''}.png")
                elif size_words in ELSEWHERE.get(key, ()):
                    save(grabbed(window), target / f"{key}-{size_words}.png")
                if key in POINTS:
                    name = f"{POINTS[key]}-{look}-{width}.png"
                    save(on_screen(window), target / "points" / name, FEW)
        window.resize(*SIZES[0])
    application.let_go(window)


def over(window: MainWindow) -> list[QWidget]:
    """Dialogs and menus that stand open over the window."""
    kinds: tuple[type[QWidget], ...] = (QDialog, QMenu)
    return [w for kind in kinds for w in window.findChildren(kind) if w.isVisible() and w.isWindow()]


def grabbed(window: MainWindow) -> QPixmap:
    """The window, or the dialog that stands open over it."""
    return (over(window)[-1:] or [window])[0].grab()


def on_screen(window: MainWindow) -> QPixmap:
    """The window with what stands open over it: a dialog in its middle, a menu where it hangs."""
    picture = window.grab()
    painter = QPainter(picture)
    for shown in over(window):
        middle = window.rect().center() - shown.rect().center()
        place = middle if isinstance(shown, QDialog) else window.mapFromGlobal(shown.pos())
        painter.setPen(QPen(shown.palette().color(QPalette.ColorRole.Mid), 2))
        painter.drawRect(QRect(place, shown.size()))
        painter.drawPixmap(place, shown.grab())
    painter.end()
    return picture


def save(shown: QPixmap, path: Path, colours: int = COLOURS) -> None:
    """A PNG with a palette of its own colours."""
    path.parent.mkdir(exist_ok=True)
    buffer = QBuffer()
    buffer.open(QBuffer.OpenModeFlag.ReadWrite)
    shown.save(buffer, "PNG")
    picture = Image.open(io.BytesIO(bytes(buffer.data().data()))).convert("RGB")
    palette = Image.new("P", (1, 1))
    palette.putpalette(palette_of(picture, colours))
    picture.quantize(palette=palette, dither=Image.Dither.NONE).save(path, optimize=True)


def palette_of(picture: Image.Image, count: int) -> list[int]:
    """Of a picture's colours those that miss it least, one by one: the frequent and the far ones first.

    A cut into boxes would give a thin curve the colour of another.
    """
    found = picture.getcolors(picture.width * picture.height)
    often = np.sqrt([number for number, _ in found])
    colours = np.array([colour for _, colour in found], dtype=float)
    chosen = [int(np.argmax(often))]
    away = np.sum((colours - colours[chosen[0]]) ** 2, axis=1)
    while len(chosen) < min(count, len(colours)):
        chosen.append(int(np.argmax(often * away)))
        away = np.minimum(away, np.sum((colours - colours[chosen[-1]]) ** 2, axis=1))
    return [round(part) for number in chosen for part in colours[number]]


if __name__ == "__main__":
    main()
