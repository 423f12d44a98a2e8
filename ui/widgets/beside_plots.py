"""The user's own plots beside a page's own; one of the two where a window is too narrow for both."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QPushButton, QWidget

from .layout import Panes, described

OWN_HELP = "Your own plots, or the others: the window is too narrow for both beside each other."


def own_switch() -> QPushButton:
    """Stands with the page's buttons; seen only where there is no room for both."""
    button = described(QPushButton("Own plots"), "ownPlots", tip=OWN_HELP)
    button.setCheckable(True)
    button.hide()
    return button


class BesidePlots(Panes):
    """A page's plots with the user's own at their right, or the one of them that ``switch`` asks for."""

    def __init__(self, page: QWidget, own: QWidget, switch: QPushButton, widths: tuple[int, int]) -> None:
        super().__init__("besidePlots", ((page, 3), (own, 1)), widths, Qt.Orientation.Horizontal)
        self._page, self._own, self._switch = page, own, switch
        self._any = False
        switch.toggled.connect(lambda _on: self._share())
        own.hide()

    @property
    def narrow(self) -> bool:
        """Whether there are plots of both kinds and room for one only."""
        both = self._page.minimumSizeHint().width() + self._own.minimumSizeHint().width()
        return self._any and self.width() < both + self.handleWidth()

    def show_own(self, there: bool) -> None:
        """Whether there are plots of the user's own."""
        self._any = there
        if not there:
            self._switch.setChecked(False)
        self._share()
        self.updateGeometry()

    def bring_forward(self) -> None:
        """A plot was just added: where only one kind is shown, it is that one."""
        self._switch.setChecked(self.narrow)

    def minimumSizeHint(self) -> QSize:
        page = self._page.minimumSizeHint()
        return page.expandedTo(self._own.minimumSizeHint()) if self._any else page

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share()

    def event(self, event: QEvent) -> bool:
        done = super().event(event)
        if event.type() == QEvent.Type.LayoutRequest:  # what stands above a plot needs more or less
            self._share()
        return done

    def _share(self) -> None:
        narrow = self.narrow
        shown = {
            self._switch: narrow,
            self._own: self._any and (not narrow or self._switch.isChecked()),
            self._page: not (narrow and self._switch.isChecked()),
        }
        for widget, on in shown.items():
            if widget.isHidden() == on:
                widget.setVisible(on)
