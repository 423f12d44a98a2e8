"""What the review shows: its channels, its runs as layers, and the two threads that read them."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, Signal

from fingerlab.core.text import DEGREE, MILLI_NEWTON_METRE, NEWTON, ScreenUnit, fixed
from fingerlab.library.reviewing import (
    BASE,
    MOST_SAMPLES,
    Pyramid,
    broken_at_gaps,
    fill,
    fold,
    load_between,
    values_at,
)
from fingerlab.report.line_units import LineUnits, line_units
from fingerlab.sessions.model import Array, Run, Session

from ..app.worker import IsCancelled, Progress, Worker


@dataclass(frozen=True)
class ReviewChannel:
    """A channel on the screen: its name, its unit, and the decimals of a value at a cursor."""

    title: str
    unit: ScreenUnit
    decimals: int
    symbol: str = ""

    def help(self) -> str:
        """Name, symbol and unit; of what is calculated the equation as well."""
        return f"{self.title}: {self.symbol} ({self.unit.symbol})"

    def text(self, value: float) -> str:
        """A value in SI with the unit of the screen."""
        return self.unit.after(fixed(value * self.unit.factor, self.decimals))


CHANNELS: Mapping[str, ReviewChannel] = {
    "motor_command": ReviewChannel("motor command", DEGREE, 2, "θ_cmd"),
    "motor_position": ReviewChannel("motor position", DEGREE, 2, "θ_m"),
    "motor_torque": ReviewChannel("motor torque", MILLI_NEWTON_METRE, 2, "τ = k_t N i"),
    "load_torque": ReviewChannel("load torque", MILLI_NEWTON_METRE, 2, "τ_L"),
    "mcp_angle": ReviewChannel("MCP angle", DEGREE, 2, "θ₁"),
    "pip_angle": ReviewChannel("PIP angle", DEGREE, 2, "θ₂"),
    "endpoint_force": ReviewChannel("endpoint force", NEWTON, 3, "F"),
}
"""The motor current is left out: it is the torque but for a constant."""
ALONG = {"motor_command": "x_cmd", "motor_position": "x", "motor_torque": "F", "load_torque": "F_L"}
"""Symbols of what an axis along a line has of them."""
ALONG_DECIMALS = 3
"""Micrometres and millinewtons."""


@lru_cache(maxsize=16)
def channels_of(line: LineUnits) -> Mapping[str, ReviewChannel]:
    """:data:`CHANNELS`; of an axis along a line in its words and units."""
    if not line.radius:
        return CHANNELS
    along = {
        name: ReviewChannel(line.called(name), line.channel(name, math.inf), ALONG_DECIMALS, symbol)
        for name, symbol in ALONG.items()
    }
    return {**CHANNELS, **along}


@dataclass(frozen=True)
class PaneSpec:
    """One plot: channel -> role of its colour; ``share`` of the height; smallest range ``least`` (screen).

    Attributes:
        along: its title for an axis along a line; empty where that has no such plot.
    """

    title: str
    unit: ScreenUnit
    share: int
    least: float
    channels: Mapping[str, str]
    wide: frozenset[str] = field(default_factory=frozenset)
    along: str = ""

    def title_of(self, line: LineUnits) -> str:
        """What it is called for an axis with these units; empty where that has no such plot."""
        return self.along if line.radius else self.title

    def unit_of(self, line: LineUnits) -> ScreenUnit:
        """Unit of its heights."""
        return channels_of(line)[next(iter(self.channels))].unit

    def least_of(self, line: LineUnits) -> float:
        """Smallest range of its heights, in that unit: the same of the arc, along a line or not."""
        return self.least * self.unit_of(line).factor / self.unit.factor


PANES = (
    PaneSpec(
        "Motor",
        DEGREE,
        10,
        0.1,
        {"motor_command": "floor", "motor_position": "measured"},
        frozenset({"motor_position"}),
        "Position",
    ),
    PaneSpec(
        "Torque",
        MILLI_NEWTON_METRE,
        10,
        0.1,
        {"motor_torque": "measured", "load_torque": "candidate"},
        frozenset({"load_torque"}),
        "Force",
    ),
    PaneSpec(
        "Joints",
        DEGREE,
        8,
        0.1,
        {"mcp_angle": "measured", "pip_angle": "candidate"},
        frozenset({"pip_angle"}),
    ),
    PaneSpec("Force", NEWTON, 7, 0.01, {"endpoint_force": "measured"}),
)


MARGIN = 1.0
"""As much again on either side is at hand, so that a short move costs nothing."""


@dataclass
class Layer:
    """Attributes: number: 0 for the run under review, else that of its line (``review_pane.py``).
    line: units of its axis. name: as the legend has it. shift: s, added to the run's time on the screen.
    samples: read last, with ``time``; version: counts how often there were others.
    """

    number: int
    run: Run
    pyramid: Pyramid
    line: LineUnits
    name: str = ""
    shift: float = 0.0
    samples: Mapping[str, Array] = field(default_factory=dict)
    asked: tuple[float, float] | None = None
    version: int = 0
    _broken: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time on the screen."""
        return self.pyramid.first_time + self.shift, self.pyramid.last_time + self.shift

    def factor(self, name: str) -> float:
        """From a channel's SI values in the file to those on the screen."""
        return channels_of(self.line)[name].unit.factor

    def take(self, samples: Mapping[str, Array]) -> None:
        """Samples that were asked for are there."""
        self.samples = samples
        self.version += 1
        self._broken = {}

    def has_samples(self, left: float, right: float) -> bool:
        """Whether the samples at hand cover what lies between two times on the screen."""
        if not self.samples:
            return False
        time, (first, last) = self.samples["time"], self.span
        return bool(
            time[0] + self.shift <= max(left, first) + 1e-9
            and time[-1] + self.shift >= min(right, last) - 1e-9
        )

    def wants_samples(self, left: float, right: float, pixels: int) -> tuple[float, float] | None:
        """Times of the run to read because the pyramid is too coarse for the picture; None for none."""
        first, last = self.pyramid.samples_between(left - self.shift, right - self.shift)
        if last - first > 2 * BASE * pixels or self.has_samples(left, right):
            return None
        wide = right - left
        for margin in (MARGIN, 0.0):
            around = left - self.shift - margin * wide, right - self.shift + margin * wide
            first, last = self.pyramid.samples_between(*around)
            if last - first <= MOST_SAMPLES:
                return around
        return None

    def series(self, name: str, left: float, right: float, pixels: int) -> tuple[Array, Array]:
        """A channel around what lies between two times on the screen, fit to be drawn."""
        first, last = self.pyramid.samples_between(left - self.shift, right - self.shift)
        if last - first <= 2 * BASE * pixels and self.has_samples(left, right):
            if name not in self._broken:
                self._broken[name] = broken_at_gaps(
                    self.samples["time"], self.samples[name], self.run.sample_rate_hz
                )
            time, values = self._broken[name]
        else:
            wide = MARGIN * (right - left)
            time, values = self.pyramid.series(
                name, left - self.shift - wide, right - self.shift + wide, round(pixels * (1 + 2 * MARGIN))
            )
        return time + self.shift, values


def limits_of(parts: list[Array], least: float) -> tuple[float, float]:
    """A range that holds all values with some air, at least so high; around 0 where there are none."""
    good = [part[np.isfinite(part)] for part in parts]
    good = [part for part in good if len(part)]
    if not good:
        return -least / 2, least / 2
    low, high = min(float(p.min()) for p in good), max(float(p.max()) for p in good)
    middle, half = (low + high) / 2, max((high - low) * 0.54, least / 2)
    return middle - half, middle + half


KEPT = 6
"""Pyramids held, the ones used last: of ten-hour runs 22 MB each."""

BROWSING = "Browsing"
"""What the sentence on a mistake of the program says failed."""

RunKey = tuple[Path, str]


class ReviewData(QObject):
    """Signals, of layers by their number: filled(number, share); sampled(layer); cycled(layer, Cycles);
    valued(list of time and values), freed(samples by channel), opened(sessions), beside(Session),
    failed(sentence, details).
    """

    filled = Signal(int, float)
    sampled = Signal(object)
    cycled = Signal(object, object)
    valued = Signal(object)
    freed = Signal(object)
    opened = Signal(object)
    beside = Signal(object)
    failed = Signal(str, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pyramids: dict[RunKey, tuple[Run, Pyramid]] = {}
        self._filler, self._reader = (Worker(self, newest_first=True) for _ in range(2))
        for worker in (self._filler, self._reader):
            worker.failed.connect(lambda failed: self.failed.emit(failed.sentence, failed.details))

    @property
    def busy(self) -> bool:
        """Whether something is being read."""
        return self._filler.busy or self._reader.busy

    def open(self, paths: Sequence[Path], read: Callable[[Path], Session]) -> None:
        """Open sessions to be reviewed."""
        self._ask("opened", lambda: tuple(read(path) for path in paths), self.opened.emit)

    def open_beside(self, path: Path, read: Callable[[Path], Session]) -> None:
        """Open a session whose runs are to be laid over those of the one under review."""
        self._ask("beside", lambda: read(path), self.beside.emit)

    def layer(self, number: int, session: Session, run: Run) -> Layer:
        """A run to draw as the layer of that number; what is not read yet is read now."""
        key = (session.path, run.name)
        kept = self._pyramids.pop(key, None)
        if kept is None or kept[0] is not run:
            kept = run, Pyramid(run, [name for name in CHANNELS if run.has(name)])
        self._pyramids[key] = kept
        while len(self._pyramids) > KEPT:
            del self._pyramids[next(iter(self._pyramids))]
        if not kept[1].complete:
            self._fill(number, *kept)
        return Layer(number, run, kept[1], line_units((session,)))

    def want_samples(self, layer: Layer, left: float, right: float) -> None:
        """Read every sample between two times of the layer's run."""
        run, pyramid = layer.run, layer.pyramid
        work = partial(load_between, run, pyramid, pyramid.channels, left, right)

        def done(found: Mapping[str, Array] | None) -> None:
            if found is not None:
                layer.take(found)
                self.sampled.emit(layer)

        self._ask(("sampled", layer.number), work, done)

    def want_free(self, layer: Layer, names: Sequence[str], left: float, right: float) -> None:
        """Read samples of any channels between two times of the layer's run; of many those at the left."""
        run = layer.run
        first, last = layer.pyramid.samples_between(left, right)
        last = min(last, first + MOST_SAMPLES)
        wanted = ["time", *(name for name in names if run.has(name))]

        def work() -> Mapping[str, Array]:
            found = run.load(wanted, first, last)
            seen = slice(*np.searchsorted(found["time"], (left, right)))
            found = {name: values[seen] for name, values in found.items()}
            time, rate = found["time"], run.sample_rate_hz
            broken = {name: broken_at_gaps(time, found[name], rate)[1] for name in wanted[1:]}
            return {**broken, "time": broken_at_gaps(time, time, rate)[0]}

        self._ask("freed", work, self.freed.emit)

    def want_values(self, layer: Layer, times: tuple[float, ...]) -> None:
        """Read the samples nearest to times of the layer's run."""

        def work() -> Any:
            return [values_at(layer.run, layer.pyramid, layer.pyramid.channels, time) for time in times]

        self._ask("valued", work, self.valued.emit)

    def want_cycles(self, layer: Layer) -> None:
        """Lay the strokes of the layer's run over one another."""
        work = partial(fold, layer.run, layer.pyramid, layer.pyramid.channels)
        self._ask(("cycled", layer.number), work, partial(self.cycled.emit, layer))

    def shut_down(self) -> None:
        """Stop both threads and wait for them."""
        self._filler.shut_down()
        self._reader.shut_down()

    def stop(self) -> None:
        """Forget what was asked for."""
        self._filler.cancel()
        self._reader.cancel()

    def _ask(self, key: Hashable, work: Callable[[], Any], done: Callable[[Any], None]) -> None:
        self._reader.start(BROWSING, lambda *_: work(), done, key)

    def _fill(self, number: int, run: Run, pyramid: Pyramid) -> None:
        def work(progress: Progress, cancelled: IsCancelled) -> None:
            fill(pyramid, run, lambda share: progress(share, ""), cancelled)

        self._filler.start(
            BROWSING,
            work,
            lambda _: self.filled.emit(number, 1.0),
            ("fill", number),
            on_progress=lambda share, _: self.filled.emit(number, share),
        )
