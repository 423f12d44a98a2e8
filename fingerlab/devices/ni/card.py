"""An NI card as a device: one exchange a cycle, or blocks where the card cannot do single points."""

from __future__ import annotations

import math
from collections import deque
from contextlib import suppress
from typing import Any

import numpy as np

from fingerlab.devices.ni.connection import (
    SAMPLES_NOT_YET_AVAILABLE,
    UNSUPPORTED,
    Connection,
    answering,
    code_of,
    translated,
)
from fingerlab.devices.ni.tasks import ReadyStop, Tasks, packed, signed_counts, write_safe
from fingerlab.devices.protocol import Clock, DeviceFault, DeviceLost, LatenessMeter, RealClock, Sample
from fingerlab.rig.daq import SafetyLines
from fingerlab.rig.file import Rig

READ_TIMEOUT = 0.1
"""s beyond the block's own length; a hundred cycles without a sample are a fault, not lateness (assumed)."""

_SURE = 0.2
"""Share of a cycle within which the sample counter, asked after a read, still belongs to that read."""


class NiCard:
    """A card of the rig file's ``[daq]``; see :class:`fingerlab.devices.protocol.Device`.

    Args:
        rig: names card, server, terminals and timing.
        clock: for lateness only; time itself is the sample index over the rate.
        channel: a gRPC channel instead of the rig's server, for tests.
    """

    def __init__(self, rig: Rig, clock: Clock | None = None, channel: Any = None) -> None:
        self.rig = rig
        self._daq = rig.daq
        self._clock: Clock = clock or RealClock()
        self._connection = Connection(self._daq, channel)
        self._tasks: Tasks | None = None
        self._ready: ReadyStop | None = None
        self._running = self._refused = False
        self._counter: Any = None  # the encoder's task, where it counts on over a stop
        self._sound = False  # the last exchange went well
        self._single_point = self._daq.timing != "buffered"
        self._index = -1
        self._doubtful = 0
        self._waiting: deque[Sample] = deque()
        self._meter = LatenessMeter(self._daq.rate_hz)

    @property
    def name(self) -> str:
        return self._connection.where

    @property
    def rate_hz(self) -> float:
        return self._daq.rate_hz

    @property
    def cycles_per_command(self) -> int:
        """1 in single-point mode, else the samples of a block; known once the card is open."""
        return 1 if self._single_point else self._daq.block

    @property
    def command_is_due(self) -> bool:
        """Whether the next exchange writes its command: in single-point mode always, else after a block."""
        return not self._waiting

    @property
    def counted_on(self) -> bool:
        """Whether the encoder was counted since before the last start."""
        return self._tasks is not None and self._tasks.counted_on

    def open(self) -> None:
        if self._tasks is not None:
            raise DeviceFault(f"{self.name} is open already; close it before it is opened again.")
        self._refused = True
        self._rest()
        self._tasks = self._build()
        self._refused = False

    def start(self) -> None:
        if self._running:
            raise DeviceFault(f"{self.name} is running already; stop it before it is started again.")
        if self._tasks is None:
            self._tasks = self._build()  # given back by a stop
        self._index, self._doubtful = -1, 0
        self._waiting.clear()
        self._meter = LatenessMeter(self.rate_hz)
        with answering(self.name):
            self._tasks.write_enable(False)
            self._tasks.start()
        self._running = self._sound = True

    def set_enable(self, on: bool) -> None:
        if self._tasks is None or (on and not self._running):
            raise DeviceFault(f"{self.name} is not running; start it before the amplifier is enabled.")
        with answering(self.name):
            self._tasks.write_enable(on)

    def exchange(self, command_volts: float) -> Sample:
        from nidaqmx.errors import Error

        if self._tasks is None or not self._running:
            raise DeviceFault(f"{self.name} is not running; start it first.")
        if not math.isfinite(command_volts):
            raise DeviceFault(f"The command is {command_volts} V; the output keeps its last value.")
        command = self._daq.command
        volts = min(max(command_volts, command.low), command.high)
        try:
            if self._single_point:
                return self._one_cycle(self._tasks, volts)
            if not self._waiting:
                self._tasks.write_volts(volts)
                self._next_block(self._tasks)
        except Error as error:
            self._sound = False
            raise translated(error, self.name) from error
        return self._waiting.popleft()

    @property
    def safety_lines(self) -> SafetyLines:
        """The digital lines of the rig file beside enable."""
        return self._daq.safety_lines

    def beat(self) -> None:
        """Invert the dead-man's line: once for each command, that is once a block where blocks are read."""
        from nidaqmx.errors import Error

        if self._tasks is None or not self._running:
            raise DeviceFault(f"{self.name} is not running; start it first.")
        if self._waiting:
            return
        try:
            self._tasks.beat()
        except Error as error:
            raise translated(error, self.name) from error

    def make_safe(self) -> bool:
        keep = self._running and self._sound
        self._running = False
        try:
            self._give_back(keep_counting=keep)
            ready, self._ready = self._ready, None
            if ready is not None and ready.write():
                return True
            # Whoever was refused the card must not take it from the program that has it.
            if not write_safe(self._connection, self._daq, reset=False):
                return True
            self._let_counter_go()  # a reset takes it
            return not write_safe(self._connection, self._daq, reset=not self._refused)
        except Exception:  # whatever it was, the caller has to be told "not confirmed" and no more
            return False

    def try_stop(self) -> None:
        """What ``make_safe`` does, tried beforehand by a guardian, while nobody drives.

        The card is not taken from a program that has it, neither now nor later; what the stop needs is ready
        from now on. Raises DeviceLost, DeviceFault.
        """
        self._refused = True
        self._rest()
        self._ready = ReadyStop(self._connection, self._daq)
        self._refused = False

    def close(self) -> None:
        self.make_safe()
        self._let_counter_go()
        self._connection.close()

    def read_back_output(self) -> float | None:
        """Volts at the output terminal, read through the card's inner channel while no task is running.

        None where the card has no such channel. Raises DeviceLost, DeviceFault.
        """
        from nidaqmx.errors import DaqError
        from nidaqmx.stream_readers import AnalogSingleChannelReader

        if self._tasks is not None:
            raise DeviceFault(f"{self.name} is in use by its own tasks; stop it before it is measured.")
        task = self._connection.task("read-back")
        with answering(self.name):
            try:
                inner = f"{self._daq.device}/_{self._daq.command.terminal}_vs_aognd"
                task.ai_channels.add_ai_voltage_chan(inner, min_val=-10.0, max_val=10.0)
                return float(AnalogSingleChannelReader(task.in_stream).read_one_sample())
            except DaqError as error:
                if isinstance(translated(error, self.name), DeviceLost):
                    raise
                return None
            finally:
                task.close()

    def abandon(self, late_write: float | None = None) -> None:
        """Stop the clock and give the tasks back without writing anything safe, to see what the card does.

        Only for ``check-rig``, with the amplifier off. ``late_write``: volts to write to the timed output
        after its clock has stopped.
        """
        self._running = False
        if self._tasks is not None and late_write is not None and self._tasks.inputs is not None:
            with answering(self.name):
                self._tasks.inputs.stop()
                self._tasks.write_volts(late_write)
        self._give_back(lower_enable=False)

    def _build(self) -> Tasks:
        """Tasks in the mode of the rig file; single-point first where the rig leaves it to the card."""
        from nidaqmx.errors import DaqError

        # A server across a network costs half a millisecond a call: too slow for one exchange a cycle.
        counter, self._counter = self._counter, None
        choice = self._daq.timing
        wanted = choice == "single-point" or (choice == "auto" and not self._connection.remote)
        wanted = wanted and (counter is None or self._single_point)  # a counter keeps its own timing
        with answering(self.name):
            if wanted:
                try:
                    tasks = Tasks(self._connection, self._daq, single_point=True, counter=counter)
                except DaqError as error:
                    if choice == "single-point" or code_of(error) not in UNSUPPORTED:
                        raise
                else:
                    self._single_point = True
                    return tasks
            self._single_point = False
            return Tasks(self._connection, self._daq, single_point=False, counter=counter)

    def _rest(self) -> None:
        """Bring the bench to rest, where nobody else has the card."""
        self._check_presence()
        refused = write_safe(self._connection, self._daq, reset=False)
        if refused:
            raise refused[0]

    def _check_presence(self) -> None:
        with answering(self.name):
            names = list(self._connection.system().devices.device_names)
        if self._daq.device not in names:
            known = f"it knows {', '.join(names)}" if names else "it knows none"
            raise DeviceLost(
                f"{self.name}: the driver knows no card of that name ({known}); correct 'device' in the rig "
                "file's [daq] or plug it in."
            )

    def _let_counter_go(self) -> None:
        from nidaqmx.errors import Error

        counter, self._counter = self._counter, None
        if counter is not None:
            with suppress(Error):
                counter.close()

    def _give_back(self, lower_enable: bool = True, keep_counting: bool = False) -> None:
        tasks, self._tasks = self._tasks, None
        if tasks is None:
            return
        from nidaqmx.errors import Error

        if lower_enable:  # at once; the fresh tasks that follow are what counts
            with suppress(Error):
                tasks.write_enable(False)
            with suppress(Error):
                tasks.write_volts(0.0)
        self._counter = tasks.discard(keep_counting)

    def _one_cycle(self, tasks: Tasks, volts: float) -> Sample:
        tasks.write_volts(volts)
        if tasks.present:
            tasks.read_volts(tasks.volts, READ_TIMEOUT)
            now = self._clock.now()
            count = tasks.read_count(READ_TIMEOUT)
        else:
            count = tasks.read_count(READ_TIMEOUT)
            now = self._clock.now()
        total = tasks.total_acquired()
        raw = self._raw(tasks, tasks.volts, signed_counts(count))
        if total is None:  # the clock alone tells how many cycles went by unseen
            late = self._meter.late_by(self._index + 1, now)
            self._index += 1 + int(late * self.rate_hz + _SURE)
        else:
            self._index = self._index_of(total, self._clock.now() - now)
        return Sample(self._index, raw, self._meter.late_by(self._index, now), tasks.read_lines())

    def _index_of(self, total: int, asked_after: float) -> int:
        """Index of the sample just read, when the card has counted ``total``, asked that many s later.

        A single cycle too many may have passed between reading and asking; it counts as lost only when
        the question came at once, or when the next cycle says so too.
        """
        beyond = total - 1 - (self._index + 1)
        if beyond == 1 and asked_after * self.rate_hz > _SURE and not self._doubtful:
            self._doubtful = 1
            return self._index + 1
        self._doubtful = 0
        return self._index + 1 + max(beyond, 0)

    def _next_block(self, tasks: Tasks) -> None:
        """Read the next block; a partial one gives what it surely holds, an unreadable one is a gap."""
        from nidaqmx.errors import DaqReadError

        size = self._daq.block
        timeout = size / self.rate_hz + READ_TIMEOUT
        volts = tasks.block_volts
        volts.fill(np.nan)
        read = size
        known: Any = volts
        if tasks.present:
            try:
                tasks.read_blocks(volts, size, timeout)
            except DaqReadError as error:
                read = error.samps_per_chan_read
                if error.error_code != SAMPLES_NOT_YET_AVAILABLE or not 0 < read <= size:
                    raise
                known = packed(volts, read)
        tasks.read_counts(tasks.block_counts, read, timeout)
        now = self._clock.now()
        self._index += read
        late = self._meter.late_by(self._index, now)
        if known is None:
            return self._next_block(tasks)
        lines = tasks.read_lines()
        for k in range(read):
            raw = self._raw(tasks, known[:, k], signed_counts(float(tasks.block_counts[k])))
            self._waiting.append(Sample(self._index - read + 1 + k, raw, late, lines))
        return None

    def _raw(self, tasks: Tasks, volts: Any, counts: float) -> tuple[float, ...]:
        values = volts.tolist()
        if len(values) == 4:
            return (*values, counts)
        raw = [math.nan] * 4
        for k, value in zip(tasks.present, values, strict=True):
            raw[k] = value
        return (*raw, counts)
