"""Colours and fonts, light and dark, following the system unless the user chose one."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from string import Template
from typing import Literal

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QFont, QGuiApplication, QPalette, QPen
from PySide6.QtWidgets import QApplication, QWidget

Appearance = Literal["system", "light", "dark"]


FRAMED = ("QAbstractSpinBox", "QLineEdit", "QPlainTextEdit", "QCheckBox", "QRadioButton", "QMenu")
"""Widgets whose outline the style derives from the window's colour, darker, which nobody sees on black."""

OUTLINE_DARKER = 1.4
"""So much darker than the window the style draws an outline."""


@dataclass(frozen=True)
class Colours:
    """What each colour means, as ``#rrggbb``; read from ``resources/style/colours.toml``."""

    window: str
    surface: str
    text: str
    muted: str
    line: str
    accent: str
    on_accent: str
    measured: str
    modelled: str
    residual: str
    floor: str
    candidate: str
    alike: str
    fault: str
    stop: str
    over: tuple[str, ...]


@cache
def _schemes() -> dict[str, Colours]:
    text = files("fingerlab.resources").joinpath("style/colours.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    return {name: Colours(**{**data[name], "over": tuple(data[name]["over"])}) for name in ("light", "dark")}


def colours_of(widget: QWidget) -> Colours:
    """The colours that a widget should draw with now, told from its palette."""
    dark = widget.palette().color(QPalette.ColorRole.Window).lightness() < 128
    return _schemes()["dark" if dark else "light"]


def light_colours() -> Colours:
    """The colours for paper, whatever the window has."""
    return _schemes()["light"]


def apply_appearance(app: QApplication, appearance: Appearance) -> None:
    """Give the application the light or the dark colours; ``system`` asks the desktop which."""
    hints = QGuiApplication.styleHints()
    scheme = {"light": Qt.ColorScheme.Light, "dark": Qt.ColorScheme.Dark}.get(appearance)
    if scheme is None:
        hints.unsetColorScheme()
        scheme = hints.colorScheme()
    elif hints.colorScheme() != scheme:
        hints.setColorScheme(scheme)  # the title bar and native dialogs follow where the desktop can
    colours = _schemes()["dark" if scheme == Qt.ColorScheme.Dark else "light"]
    app.setPalette(_palette(colours))
    for name in FRAMED:
        app.setPalette(_framed_palette(colours), name)  # type: ignore[arg-type]  # the stub is wrong
    template = files("fingerlab.resources").joinpath("style/window.qss").read_text(encoding="utf-8")
    values = {field.name: str(getattr(colours, field.name)) for field in fields(colours)}
    soft = {f"{name}_soft": _mixed(values[name], colours.surface, SOFT) for name in BEHIND_WORDS}
    off = _mixed(colours.muted, colours.surface, OFF)
    app.setStyleSheet(Template(template).substitute(values, off=off, **soft))


BEHIND_WORDS = ("accent", "candidate", "fault")
SOFT = 0.3
"""Of a colour behind words, which stay legible on it."""
OFF = 0.5
"""Of the quiet colour in words of what cannot be used now."""


def _mixed(colour: str, ground: str, share: float) -> str:
    """A share of a colour, the rest the ground's, as ``#rrggbb``."""
    one, other = QColor(colour), QColor(ground)
    pairs = ((one.red(), other.red()), (one.green(), other.green()), (one.blue(), other.blue()))
    return QColor(*(round(share * mine + (1 - share) * its) for mine, its in pairs)).name()


def _palette(colours: Colours) -> QPalette:
    role = QPalette.ColorRole
    palette = QPalette()
    for target, colour in {
        role.Window: colours.window,
        role.WindowText: colours.text,
        role.Base: colours.surface,
        role.AlternateBase: colours.window,
        role.Text: colours.text,
        role.Button: colours.window,
        role.ButtonText: colours.text,
        role.PlaceholderText: colours.muted,
        role.ToolTipBase: colours.surface,
        role.ToolTipText: colours.text,
        role.Highlight: colours.accent,
        role.HighlightedText: colours.on_accent,
        role.Link: colours.accent,
        role.Mid: colours.line,
        role.Light: colours.surface,
        role.Midlight: colours.line,
        role.Dark: colours.muted,
        role.Shadow: colours.muted,
    }.items():
        palette.setColor(target, QColor(colour))
    for target in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, target, QColor(colours.muted))
    return palette


def _framed_palette(colours: Colours) -> QPalette:
    """As all, with a window colour from which the style comes to an outline that can be seen."""
    palette = _palette(colours)
    outline = QColor(colours.line)
    if QColor(colours.window).lightness() < 128:
        muted = QColor(colours.muted)
        pairs = (
            (outline.red(), muted.red()),
            (outline.green(), muted.green()),
            (outline.blue(), muted.blue()),
        )
        outline = QColor(*((one + other) // 2 for one, other in pairs))
    value = min(round(outline.value() * OUTLINE_DARKER), 255)
    lighter = QColor.fromHsv(max(outline.hue(), 0), outline.saturation(), value)
    palette.setColor(QPalette.ColorRole.Window, lighter)
    return palette


def line(colour: str, width: float = 1.0, dashed: bool = False) -> QPen:
    """A pen whose width (device pixels) does not change with zoom."""
    style = Qt.PenStyle.DashLine if dashed else Qt.PenStyle.SolidLine
    pen = QPen(QColor(colour), width, style)
    pen.setCosmetic(True)
    return pen


def tint(colour: str, alpha: float) -> QColor:
    """A see-through colour for bands."""
    result = QColor(colour)
    result.setAlphaF(alpha)
    return result


def large_font() -> QFont:
    """For headings and the verdict; the one type family in the largest of its three sizes."""
    return _scaled(1.25)


def small_font() -> QFont:
    """For legends, ticks and side remarks."""
    return _scaled(0.9)


def _scaled(factor: float) -> QFont:
    font = QFont(QApplication.font())
    if font.pointSizeF() > 0:
        font.setPointSizeF(font.pointSizeF() * factor)
    else:
        font.setPixelSize(round(font.pixelSize() * factor))
    return font
