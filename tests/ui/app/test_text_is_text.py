"""What others wrote is shown as they wrote it: a title, a note or a file's name is no markup of ours."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
from PySide6.QtCore import QAbstractItemModel, QAbstractListModel, QModelIndex
from PySide6.QtGui import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QGraphicsTextItem,
    QGraphicsView,
    QLabel,
    QTableView,
    QWidget,
)
from pytestqt.qtbot import QtBot

from fingerlab.ui.app.tab_registry import TABS
from fingerlab.ui.app.window import MainWindow

from ..hands import child, invented_diagnosis, wait_for_result

MARKED = "zebra"
MARKUP = f"<b>{MARKED}"
WRITTEN = (MARKUP, f"&lt;b&gt;{MARKED}")
"""As plain text, and as it stands in rich text of ours."""


def odd(file: h5py.File) -> None:
    """Each text that a session can bring along, with markup and with mathematics that is none."""
    for name in ("title", "operator", "notes", "tags"):
        file.attrs[name] = f"{MARKUP} $x_{{$ {name}"
    runs = file["runs"]
    runs.move("001", MARKUP)
    for run in runs.values():
        run.move("mcp_angle", "kept")
        run["mcp_angle"] = run["kept"]
        run.move("kept", f"{MARKUP} channel")
        run.attrs["comment"] = MARKUP


def texts(window: QWidget) -> Iterator[tuple[str, str, bool]]:
    """Where a text of the window stands, the text, and whether markup in it would be obeyed."""
    for widget in [window, *window.findChildren(QWidget)]:
        where = f"{type(widget).__name__} {widget.objectName()}"
        yield f"tooltip of {where}", widget.toolTip(), Qt.mightBeRichText(widget.toolTip())
        if isinstance(widget, QLabel):
            kind = widget.textFormat()
            rich = kind == Qt.TextFormat.RichText or (
                kind == Qt.TextFormat.AutoText and Qt.mightBeRichText(widget.text())
            )
            yield where, widget.text(), rich
        if isinstance(widget, (QAbstractItemView, QComboBox)):
            yield from ((f"tip in {where}", tip, Qt.mightBeRichText(tip)) for tip in tips(widget.model()))
        if isinstance(widget, QGraphicsView) and widget.scene() is not None:
            for item in widget.scene().items():
                yield f"tooltip in {where}", item.toolTip(), Qt.mightBeRichText(item.toolTip())
                if isinstance(item, QGraphicsTextItem):  # markup that was obeyed is gone from it
                    yield f"text in {where}", item.toPlainText(), False


def tips(model: QAbstractItemModel | None) -> Iterator[str]:
    for row in range(0 if model is None else model.rowCount(QModelIndex())):
        assert model is not None
        columns = 1 if isinstance(model, QAbstractListModel) else model.columnCount(QModelIndex())
        for column in range(columns):
            yield str(model.index(row, column).data(Qt.ItemDataRole.ToolTipRole) or "")


def test_markup_of_a_session_is_obeyed_nowhere(
    make_window: Callable[..., MainWindow], make_session: Callable[..., Path], tmp_path: Path, qtbot: QtBot
) -> None:
    path = make_session(f"{MARKUP}.h5", odd, (("on_air", "extension"),) * 3)
    window = make_window(diagnose=invented_diagnosis)
    window.context.settings.set_recordings(tmp_path)
    window.open_paths([path])
    wait_for_result(qtbot, window)
    seen, wrong = 0, []
    for entry in TABS:
        window.show_tab(entry.key)
        if entry.key == "sessions":
            table = child(window, QTableView, "sessionTable")
            qtbot.waitUntil(lambda table=table: table.model().rowCount(QModelIndex()) > 0)
            table.selectRow(0)
        qtbot.wait(100)
        for where, text, obeyed in texts(window):
            if MARKED not in text:
                continue
            seen += 1
            if (obeyed and WRITTEN[1] not in text) or not any(words in text for words in WRITTEN):
                wrong.append(f"{entry.key}: {where}: {text}")
    assert not wrong, "\n".join(dict.fromkeys(wrong))
    assert seen > 10
