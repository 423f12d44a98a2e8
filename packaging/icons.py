"""Make the icon files that desktops want, from one drawing: ``python packaging/icons.py FOLDER``.

Writes ``fingerlab.png`` (256 pixels, for Linux), ``fingerlab.ico`` (Windows) and ``fingerlab.icns`` (macOS)
from ``resources/icon/fingerlab.svg``; any of them can be made on any system.
"""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DRAWING = ROOT / "resources" / "icon" / "fingerlab.svg"
ICO_SIZES = (16, 24, 32, 48, 64, 128, 256)
"""Pixels; 256 is the largest that the ICO format has."""
ICNS_SIZES = (16, 32, 64, 128, 256, 512, 1024)
"""Pixels of the sizes that macOS shows, single and doubled."""


def draw(pixels: int) -> bytes:
    """The drawing as a PNG of ``pixels`` by ``pixels``."""
    from PySide6.QtCore import QBuffer, QByteArray, QIODevice
    from PySide6.QtGui import QImage, QPainter
    from PySide6.QtSvg import QSvgRenderer

    image = QImage(pixels, pixels, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(0)
    painter = QPainter(image)
    QSvgRenderer(str(DRAWING)).render(painter)
    painter.end()
    data = QByteArray()
    buffer = QBuffer(data)
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    image.save(buffer, "PNG")  # type: ignore[call-overload]  # its stubs want bytes, it itself wants str
    return bytes(data.data())


def make_icons(folder: Path) -> dict[str, Path]:
    """Write the icon files into ``folder``; by kind: ``png``, ``ico``, ``icns``."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    from PIL import Image
    from PySide6.QtGui import QGuiApplication

    application = QGuiApplication.instance() or QGuiApplication([])
    drawn = {size: Image.open(io.BytesIO(draw(size))) for size in sorted({*ICO_SIZES, *ICNS_SIZES})}
    folder.mkdir(parents=True, exist_ok=True)
    made = {kind: folder / f"fingerlab.{kind}" for kind in ("png", "ico", "icns")}
    drawn[256].save(made["png"])
    # Each size is drawn anew, not scaled down, so that the small ones are sharp.
    smaller = [drawn[size] for size in ICO_SIZES[:-1]]
    drawn[256].save(made["ico"], sizes=[(s, s) for s in ICO_SIZES], append_images=smaller)
    drawn[1024].save(made["icns"], append_images=[drawn[size] for size in ICNS_SIZES[:-1]])
    del application
    return made


def main(arguments: list[str]) -> int:
    """Make the files and say where they are."""
    for path in make_icons(Path(arguments[0]) if arguments else ROOT / "build" / "icons").values():
        print(f"{path}  {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
