"""What Acquire shows, the last minutes of it, and what each pixel column of a plot shows of them. No Qt.

From frame to frame a live plot only gains the few columns that time has moved on by. A column is numbered by
the samples that lie in it, so that it keeps its number while it moves to the left, and is measured once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fingerlab.core.text import (
    AMPERE,
    DEGREE,
    DEGREE_A_SECOND,
    MILLI_NEWTON_METRE,
    MILLISECOND,
    NEWTON,
    VOLT,
    ScreenUnit,
    fixed,
)
from fingerlab.sessions.model import Array

MODELLED_TORQUE = "modelled_torque"
MODELLED_FORCE = "modelled_force"
TORQUE_RESIDUAL = "torque_residual"
FORCE_RESIDUAL = "force_residual"
MODELLED = (MODELLED_TORQUE, MODELLED_FORCE, TORQUE_RESIDUAL, FORCE_RESIDUAL)


@dataclass(frozen=True)
class LiveQuantity:
    """One measured or modelled quantity.

    Attributes:
        column: of the ring, or of the model. title: as an operator says. digits: behind the point.
        help: symbol, unit and where it comes from.
    """

    column: str
    title: str
    unit: ScreenUnit
    digits: int
    help: str

    def text(self, value: float) -> str:
        """A value (SI) with its unit, in a width that does not change from one value to the next."""
        if value != value:
            return self.unit.after("–")
        return self.unit.after(fixed(value * self.unit.factor, self.digits))  # never "−0.00"


AS_READ = "U (V): as it is read at the terminal, before any scaling."
BALANCE = "by the PIP balance LHS₂ = s b T + L₂ − lever F, thesis (3.17), (3.18)"
QUANTITIES = {
    quantity.column: quantity
    for quantity in (
        LiveQuantity("motor_command", "Command", DEGREE, 1, "θ_cmd (°): where the pulley is told to be."),
        LiveQuantity(
            "motor_position", "Position", DEGREE, 1, "θ_m (°): the pulley's angle, from the encoder."
        ),
        LiveQuantity("motor_speed", "Speed", DEGREE_A_SECOND, 0, "ω = dθ_m/dt (°/s), over 10 ms."),
        LiveQuantity("motor_torque", "Torque", MILLI_NEWTON_METRE, 1, "τ = k_t N i (mN m) at the pulley."),
        LiveQuantity("motor_current", "Current", AMPERE, 2, "i (A): the amplifier's current monitor."),
        LiveQuantity("mcp_angle", "MCP", DEGREE, 1, "θ₁ (°): knuckle angle, flexion positive."),
        LiveQuantity("pip_angle", "PIP", DEGREE, 1, "θ₂ (°): middle joint's angle, flexion positive."),
        LiveQuantity("endpoint_force", "Force", NEWTON, 2, "F (N): the load cell under the fingertip."),
        LiveQuantity("current_command", "Set current", AMPERE, 2, "i (A): what the amplifier is told."),
        LiveQuantity("raw/force_volts", "Load cell volts", VOLT, 3, AS_READ),
        LiveQuantity("raw/mcp_volts", "MCP volts", VOLT, 3, AS_READ),
        LiveQuantity("raw/pip_volts", "PIP volts", VOLT, 3, AS_READ),
        LiveQuantity("raw/current_volts", "Monitor volts", VOLT, 3, AS_READ),
        LiveQuantity("lateness", "Lateness", MILLISECOND, 2, "How late the control loop's cycle came (ms)."),
        LiveQuantity(MODELLED_TORQUE, "Modelled torque", MILLI_NEWTON_METRE, 1, f"r T (mN m), {BALANCE}."),
        LiveQuantity(MODELLED_FORCE, "Modelled force", NEWTON, 2, f"F (N), {BALANCE}."),
        LiveQuantity(TORQUE_RESIDUAL, "Torque residual", MILLI_NEWTON_METRE, 1, "τ less r T (mN m)."),
        LiveQuantity(FORCE_RESIDUAL, "Force residual", NEWTON, 2, "F measured less F modelled (N)."),
    )
}

SHOWN = tuple(name for name in QUANTITIES if name not in MODELLED)
"""Columns that are taken from the ring."""


@dataclass(frozen=True)
class LiveTrace:
    """A curve: its quantity, the role that gives its colour, and whether its line is wide.

    Colour never tells alone: of two curves in a plot one is wide.
    """

    column: str
    role: str
    wide: bool = False


@dataclass(frozen=True)
class LivePlotSpec:
    """One plot.

    Attributes:
        key, title, unit: of the left axis. share: of the height. least: smallest automatic range (screen
            unit), so that noise does not fill the plot. model: shown only beside a model.
        readings: quantities shown large above it.
    """

    key: str
    title: str
    unit: ScreenUnit
    share: int
    least: float
    traces: tuple[LiveTrace, ...]
    readings: tuple[str, ...] = ()
    model: bool = False


PLOTS = (
    LivePlotSpec(
        "displacement",
        "Motor",
        DEGREE,
        10,
        4.0,
        (LiveTrace("motor_command", "floor"), LiveTrace("motor_position", "measured", wide=True)),
        ("motor_command", "motor_position", "motor_speed"),
    ),
    LivePlotSpec(
        "torque",
        "Torque",
        MILLI_NEWTON_METRE,
        10,
        10.0,
        (LiveTrace("motor_torque", "measured"), LiveTrace(MODELLED_TORQUE, "modelled", wide=True)),
        ("motor_torque", "motor_current"),
    ),
    LivePlotSpec(
        "torque_residual",
        "Residual",
        MILLI_NEWTON_METRE,
        5,
        5.0,
        (LiveTrace(TORQUE_RESIDUAL, "residual"),),
        model=True,
    ),
    LivePlotSpec(
        "angles",
        "Joints",
        DEGREE,
        6,
        4.0,
        (LiveTrace("mcp_angle", "measured"), LiveTrace("pip_angle", "candidate", wide=True)),
        ("mcp_angle", "pip_angle"),
    ),
    LivePlotSpec(
        "force",
        "Force",
        NEWTON,
        6,
        0.2,
        (LiveTrace("endpoint_force", "measured"), LiveTrace(MODELLED_FORCE, "modelled", wide=True)),
        ("endpoint_force",),
    ),
    LivePlotSpec(
        "force_residual", "Residual", NEWTON, 5, 0.1, (LiveTrace(FORCE_RESIDUAL, "residual"),), model=True
    ),
)


HISTORY_S = 240.0
"""How far one can scroll back: as far as the ring goes."""


class LiveHistory:
    """A buffer whose newest samples always lie in one piece: two copies' length, moved when it is full.

    Sample ``index`` of the bench is at ``index - first``; samples that never came are NaN.
    """

    def __init__(self, names: Sequence[str], rate_hz: float, seconds: float = HISTORY_S) -> None:
        self.names = tuple(names)
        self.rate_hz = rate_hz
        self._row = {name: row for row, name in enumerate(self.names)}
        self._capacity = round(seconds * rate_hz)
        # Of what it adds :meth:`extend` makes NaN; to write 70 MB of it now holds up every connecting.
        self._data = np.empty((len(self.names), 2 * self._capacity))
        self._begin = self._end = 0
        self._known: dict[str, int] = {}
        self.first = 0
        """Index of the oldest sample."""
        self.epoch = 0
        """Raised when all is forgotten: what was seen before may be other samples of the same index."""

    @property
    def stop(self) -> int:
        """Index after the newest sample."""
        return self.first + self._end - self._begin

    def __len__(self) -> int:
        return self._end - self._begin

    def clear(self, first: int = 0) -> None:
        """Forget all; the next sample is ``first``."""
        self._begin = self._end = 0
        self._known.clear()
        self.first = first
        self.epoch += 1

    def extend(self, index: Array, columns: Mapping[str, Array]) -> bool:
        """Append samples of increasing index, shape (n,); whether they follow without a gap.

        Columns that are not given are NaN until :meth:`fill`.
        """
        if not len(index):
            return True
        start, stop = int(index[0]), int(index[-1]) + 1
        whole = start == self.stop and stop - start == len(index)
        if not len(self) or start < self.stop or start - self.stop >= self._capacity:
            self.clear(start)
        room = min(stop - self.stop, self._capacity)
        if stop - self.stop > room:
            self.clear(stop - room)
        self._make_room(room)
        self._data[:, self._end : self._end + room] = np.nan
        place = self._end + np.asarray(index, dtype=np.intp) - self.stop
        good = place >= self._end
        for name, values in columns.items():
            self._data[self._row[name], place[good]] = values[good]
        self._end += room
        self._known.update(dict.fromkeys(columns, self.stop))
        extra = len(self) - self._capacity
        if extra > 0:
            self._begin += extra
            self.first += extra
        return whole

    def fill(self, stop: int, columns: Mapping[str, Array]) -> None:
        """Set columns of samples that end before index ``stop``, such as modelled ones that come later."""
        for name, values in columns.items():
            start = stop - len(values)
            low, high = max(start, self.first), min(stop, self.stop)
            if high > low:
                at = self._begin + low - self.first
                self._known[name] = high
                self._data[self._row[name], at : at + high - low] = values[low - start : high - start]

    def known(self, name: str) -> int:
        """Index after the newest sample of a column that will not change any more."""
        return self._known.get(name, self.first)

    def time(self, start: int, stop: int) -> Array:
        """Seconds since the bench's first sample, of samples ``start`` to ``stop``."""
        return np.arange(start, stop) / self.rate_hz

    def series(self, name: str, start: int, stop: int) -> tuple[int, Array]:
        """Samples from ``start`` to ``stop`` as far as they are here: index of the first, and a view."""
        low, high = max(start, self.first), min(stop, self.stop)
        if high <= low:
            return max(low, self.first), np.empty(0)
        at = self._begin + low - self.first
        return low, self._data[self._row[name], at : at + high - low]

    def value(self, name: str, index: int) -> float:
        """One sample, NaN where it is not here."""
        if not self.first <= index < self.stop:
            return float("nan")
        return float(self._data[self._row[name], self._begin + index - self.first])

    def _make_room(self, count: int) -> None:
        if self._end + count <= self._data.shape[1]:
            return
        kept = min(len(self), self._capacity)
        self.first = self.stop - kept
        self._data[:, :kept] = self._data[:, self._end - kept : self._end].copy()
        self._begin, self._end = 0, kept


ColumnRun = tuple[int, int]
"""Columns from, to (not included)."""


@dataclass(frozen=True)
class ColumnView:
    """Columns ``first`` to ``first + count``; column ``c`` reaches from sample ``c * wide`` to the next one.

    Attributes:
        wide: samples in a column, not whole as a rule, and less than one where the picture is closely zoomed.
    """

    first: int
    count: int
    wide: float

    @classmethod
    def ending(cls, stop: int, samples: float, count: int) -> ColumnView:
        """The ``count`` columns over ``samples`` samples of which the last holds sample ``stop - 1``."""
        wide = samples / count
        return cls(math.ceil(stop / wide - 1e-9) - count, count, wide)

    @property
    def stop(self) -> int:
        """The column after the last."""
        return self.first + self.count

    def seconds(self, rate_hz: float) -> tuple[float, float]:
        """Times of the outer edges."""
        return self.first * self.wide / rate_hz, self.stop * self.wide / rate_hz


class PixelColumns:
    """Smallest and largest value of each curve within each column, the way to its neighbours included.

    Attributes:
        low, high: shape (curves, columns), in the unit of the samples; column ``c`` is at ``c % columns``;
            NaN where a curve has nothing.
    """

    def __init__(self) -> None:
        self.low = self.high = np.empty((0, 0))
        self._of: tuple[object, ...] = ()
        self._kept: ColumnRun = (0, 0)
        self._settled = 0

    def follow(self, history: LiveHistory, names: Sequence[str | None], view: ColumnView) -> list[ColumnRun]:
        """Measure what is new in ``view``; the columns that may differ from what they were.

        Args:
            names: the curves' columns in the history; None for a curve that is not shown.
        """
        of = (history, history.epoch, tuple(names), view.count, view.wide)
        if of != self._of:
            self._of = of
            self.low, self.high = (np.full((len(names), view.count), np.nan) for _ in range(2))
            self._kept = (view.first, view.first)
        newest = [(history.known(name) - 1) // view.wide for name in names if name is not None]
        runs = self._changed(view, math.ceil(max(newest, default=view.first)) + 1)
        for start, stop in runs:
            slots = np.arange(start, stop) % view.count
            for row, name in enumerate(names):
                if name is not None:
                    self.low[row, slots], self.high[row, slots] = extremes(
                        history, name, start, stop, view.wide
                    )
        self._kept = (view.first, view.stop)
        self._settled = math.floor(min(newest, default=view.stop))
        return runs

    def _changed(self, view: ColumnView, newest: int) -> list[ColumnRun]:
        """Columns that are not kept, and those kept that samples have come into since."""
        left, right = max(self._kept[0], view.first), min(self._kept[1], view.stop)
        if right <= left:
            return [(view.first, view.stop)]
        grown = max(min(self._settled, right), left), min(newest, right)
        if grown[1] == right > grown[0]:  # up to the right edge: one run with what is new there
            runs = [(view.first, left), (grown[0], view.stop)]
        else:
            runs = [(view.first, left), grown, (right, view.stop)]
        return [(start, stop) for start, stop in runs if stop > start]


def extremes(history: LiveHistory, name: str, start: int, stop: int, wide: float) -> tuple[Array, Array]:
    """Smallest and largest value of the broken line through the samples, in columns ``start`` to ``stop``.

    Values at the columns' edges are taken from the line between the samples beside them, so that neighbours
    join; a gap stays a gap, and a sample between two gaps stays a dot.
    """
    edges = np.arange(start, stop + 1) * wide
    begin, end = math.floor(edges[0]), math.floor(edges[-1]) + 2
    first, values = history.series(name, begin, end)
    if len(values) < end - begin:
        padded = np.full(end - begin, np.nan)
        padded[first - begin : first - begin + len(values)] = values
        values = padded
    below = np.floor(edges)
    part, before = edges - below, below.astype(np.intp) - begin
    left = values[before]
    with np.errstate(invalid="ignore"):
        on_edge = np.where(part > 0, left + part * (values[before + 1] - left), left)
    inside = np.ceil(edges).astype(np.intp) - begin
    pairs = np.column_stack((inside[:-1], inside[1:])).ravel()
    low = np.fmin.reduceat(values, pairs)[::2]
    high = np.fmax.reduceat(values, pairs)[::2]
    if wide < 1:
        empty = inside[1:] == inside[:-1]
        low[empty] = high[empty] = np.nan
    low = np.fmin(low, np.fmin(on_edge[:-1], on_edge[1:]))
    high = np.fmax(high, np.fmax(on_edge[:-1], on_edge[1:]))
    return low, high
