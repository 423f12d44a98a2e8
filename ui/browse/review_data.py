"""Reads what the review shows, in two threads: one fills pyramids, one answers what is looked at now."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal

from fingerlab.library.pyramid import Pyramid, fill
from fingerlab.library.reviewing import fold, load_between, values_at
from fingerlab.sessions.model import Run, Session

from .background import Background, IsCancelled, Tell
from .layer import Layer
from .quantities import QUANTITIES

KEPT = 6
"""Pyramids held, the ones used last: of ten-hour runs 22 MB each."""

RunKey = tuple[Path, str]


class ReviewData(QObject):
    """Signals, of layers by their number: filled(number, share); sampled(layer); cycled(layer, Cycles);
    valued(list of time and values), opened(sessions), beside(Session), failed(sentence, details).
    """

    filled = Signal(int, float)
    sampled = Signal(object)
    cycled = Signal(object, object)
    valued = Signal(object)
    opened = Signal(object)
    beside = Signal(object)
    failed = Signal(str, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pyramids: dict[RunKey, tuple[Run, Pyramid]] = {}
        self._filler, self._reader = Background(self), Background(self)
        self._filler.told.connect(lambda key, share: self.filled.emit(key[1], share))
        self._filler.done.connect(lambda key, _: self.filled.emit(key[1], 1.0))
        self._reader.done.connect(self._on_read)
        for thread in (self._filler, self._reader):
            thread.failed.connect(lambda _key, sentence, details: self.failed.emit(sentence, details))

    @property
    def busy(self) -> bool:
        """Whether something is being read."""
        return self._filler.busy or self._reader.busy

    def open(self, paths: Sequence[Path], read: Callable[[Path], Session]) -> None:
        """Open sessions to be reviewed."""
        self._ask("opened", lambda tell, cancelled: tuple(read(path) for path in paths))

    def open_beside(self, path: Path, read: Callable[[Path], Session]) -> None:
        """Open a session whose runs are to be laid over those of the one under review."""
        self._ask("beside", lambda tell, cancelled: read(path))

    def layer(self, number: int, session: Session, run: Run) -> Layer:
        """A run to draw as the layer of that number; what is not read yet is read now."""
        key = (session.path, run.name)
        kept = self._pyramids.pop(key, None)
        if kept is None or kept[0] is not run:
            kept = run, Pyramid(run, [name for name in QUANTITIES if run.has(name)])
        self._pyramids[key] = kept
        while len(self._pyramids) > KEPT:
            del self._pyramids[next(iter(self._pyramids))]
        if not kept[1].complete:
            self._filler.ask(("fill", number), partial(_fill, *kept))
        return Layer(number, run, kept[1])

    def want_samples(self, layer: Layer, left: float, right: float) -> None:
        """Read every sample between two times of the layer's run."""
        run, pyramid = layer.run, layer.pyramid
        work = partial(load_between, run, pyramid, pyramid.channels, left, right)
        self._ask(("sampled", layer.number), lambda tell, cancelled: (layer, work()))

    def want_values(self, layer: Layer, times: tuple[float, ...]) -> None:
        """Read the samples nearest to times of the layer's run."""

        def work(tell: Tell, cancelled: IsCancelled) -> Any:
            return [values_at(layer.run, layer.pyramid, layer.pyramid.channels, time) for time in times]

        self._ask("valued", work)

    def want_cycles(self, layer: Layer) -> None:
        """Lay the strokes of the layer's run over one another."""
        work = partial(fold, layer.run, layer.pyramid, layer.pyramid.channels)
        self._ask(("cycled", layer.number), lambda tell, cancelled: (layer, work()))

    def shut_down(self) -> None:
        """Stop both threads and wait for them."""
        self._filler.shut_down()
        self._reader.shut_down()

    def stop(self) -> None:
        """Forget what was asked for."""
        self._filler.clear()
        self._reader.clear()

    def _ask(self, key: Any, work: Any) -> None:
        self._reader.ask(key, work)

    def _on_read(self, key: Any, result: Any) -> None:
        if not isinstance(key, tuple):
            signals = {"valued": self.valued, "opened": self.opened, "beside": self.beside}
            signals[key].emit(result)
            return
        layer, found = result
        if key[0] == "cycled":
            self.cycled.emit(layer, found)
        elif found is not None:
            layer.take(found)
            self.sampled.emit(layer)


def _fill(run: Run, pyramid: Pyramid, tell: Tell, cancelled: IsCancelled) -> None:
    fill(pyramid, run, tell, cancelled)
