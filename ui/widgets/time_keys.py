"""Zoom and pan of a time axis by the keyboard, the same in every plot over time."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent

ZOOM_STEP = 1.5
PAN_STEP = 0.1
"""Share of the shown time that one press of an arrow moves."""


def move_by_key(plot: pg.PlotItem, event: QKeyEvent) -> bool:
    """Zoom with plus and minus, pan with the arrows; False where the key is another one."""
    left, right = plot.viewRange()[0]
    middle, half = (left + right) / 2, (right - left) / 2
    key = event.key()
    if key in (Qt.Key.Key_Plus, Qt.Key.Key_Equal):
        half /= ZOOM_STEP
    elif key == Qt.Key.Key_Minus:
        half *= ZOOM_STEP
    elif key in (Qt.Key.Key_Left, Qt.Key.Key_Right):
        middle += (1 if key == Qt.Key.Key_Right else -1) * 2 * half * PAN_STEP
    else:
        return False
    plot.setXRange(middle - half, middle + half, padding=0)
    return True
