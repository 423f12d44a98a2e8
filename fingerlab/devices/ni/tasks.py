"""The timed tasks of the bench on one card, and those without a clock that bring the bench to rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from fingerlab.devices.ni.connection import UNSUPPORTED, Connection, answering, code_of, translated
from fingerlab.devices.protocol import NO_LINES, DeviceFault
from fingerlab.rig.daq import AmplifierReadyLine, Daq, EmergencyStopLine

BUFFER_SECONDS = 4.0
"""Length of the driver's buffer in the buffered mode: how long the program may be stalled (assumed)."""

LINES_TIMEOUT = 0.1
"""s for a read on demand, which does not wait for any clock (assumed)."""

_HALF_RANGE = 2.0**31


class Tasks:
    """Reserved and configured tasks, not yet started.

    Args:
        single_point: one sample a cycle; otherwise blocks, and a set value that is written on demand.
        counter: the encoder's task of tasks that were discarded but for it, and counts on.

    Raises (at construction):
        nidaqmx.errors.Error: the driver refuses; nothing stays reserved.
    """

    def __init__(
        self, connection: Connection, daq: Daq, single_point: bool, counter: Any | None = None
    ) -> None:
        self._daq = daq
        self._open: list[Any] = []
        self.single_point = single_point
        self._counts_cycles = True
        self.present = [k for k, channel in enumerate(daq.inputs) if channel.terminal]
        # Each digital input: its place among the device's LINES, and whether 5 V mean "yes".
        wired: tuple[EmergencyStopLine | AmplifierReadyLine, ...] = (daq.emergency_stop, daq.amplifier_ready)
        self._inputs = [(k, line) for k, line in enumerate(wired) if line.terminal]
        self._beat = False
        try:
            self.enable = self._make(connection, "enable", self._add_enable)
            beats = bool(daq.dead_man.terminal)
            self.dead_man = self._make(connection, "dead-man", self._add_dead_man) if beats else None
            self.lines = self._make(connection, "lines", self._add_lines) if self._inputs else None
            self.output = self._make(connection, "set-value", self._add_output)
            self.counted_on = counter is not None
            if counter is not None:
                self._open.append(counter)
            self.counter = counter or self._make(connection, "encoder", self._add_encoder)
            self.inputs = self._make(connection, "inputs", self._add_inputs) if self.present else None
            self._bind()
            self._commit()
        except BaseException:
            self.discard()
            raise

    def start(self) -> None:
        """Start the clock, the output at zero. Counter and output come first: the analog task is the clock.

        A counter that is started later would begin on another edge than the analog channels. A single-point
        output refuses a value before it is started (-200803), and has none to give before the clock runs.
        """
        if self.counted_on:
            self._skip_what_was_not_read()
        else:
            self.counter.start()
        if self.single_point:
            self.output.start()
        self.write_volts(0.0)
        if self.inputs is not None:
            self.inputs.start()

    def discard(self, keep_counting: bool = False) -> Any | None:
        """Give everything back, in whatever state it is. Never raises for what the driver says.

        Args:
            keep_counting: but for the counter, which only waits for edges of a clock that stands.

        Returns:
            The counter's task where it was kept.
        """
        from nidaqmx.errors import DaqError, Error

        # ASSUMPTION counter-counts-on: an armed counter counts whether its sample clock runs or not.
        kept = self.counter if keep_counting and self.inputs is not None else None
        while self._open:
            task = self._open.pop()
            if task is kept:
                continue
            try:
                with suppress(DaqError):
                    task.stop()
                with suppress(DaqError):
                    task.close()
            except Error:
                self._open.clear()  # no server any more: each further call would only wait for it
                return None
        return kept

    def _skip_what_was_not_read(self) -> None:
        """The counts at edges before the stop that nobody has read: they would be taken for the next ones."""
        if self.single_point:
            return
        waiting = int(self.counter.in_stream.avail_samp_per_chan)
        if waiting:
            self.read_counts(np.zeros(waiting), waiting, LINES_TIMEOUT)

    def total_acquired(self) -> int | None:
        """Cycles of the sample clock since the start; None where the device does not count single points."""
        from nidaqmx.errors import DaqError

        if not self._counts_cycles:
            return None
        try:
            return int(self._clock_stream.total_samp_per_chan_acquired)
        except DaqError as error:
            if code_of(error) not in UNSUPPORTED:
                raise
            self._counts_cycles = False
            return None

    def write_enable(self, on: bool) -> None:
        """Set the enable line."""
        self._enable_writer.write_one_sample_one_line(on == self._daq.enable.active_high)

    def beat(self) -> None:
        """Invert the dead-man's line, on demand: no clock of the card makes it change."""
        self._beat = not self._beat
        self._beat_writer.write_one_sample_one_line(self._beat)

    def read_lines(self) -> tuple[float, float]:
        """The digital inputs as they are now, in the order of the protocol's ``LINES``."""
        if self.lines is None:
            return NO_LINES
        self._lines_reader.read_one_sample_one_line(self._levels, LINES_TIMEOUT)
        states = [math.nan, math.nan]
        for (k, line), level in zip(self._inputs, self._levels.tolist(), strict=True):
            states[k] = float(level is line.active_high)
        return states[0], states[1]

    def _make(self, connection: Connection, purpose: str, add: Callable[[Any], None]) -> Any:
        task = connection.task(purpose)
        self._open.append(task)
        add(task)
        return task

    def _add_inputs(self, task: Any) -> None:
        for k in self.present:
            add_analog_input(task, self._daq, k)
        self._time(task, "")

    def _add_encoder(self, task: Any) -> None:
        from nidaqmx.constants import AngleUnits, EncoderType

        encoder = self._daq.encoder
        channel = task.ci_channels.add_ci_ang_encoder_chan(
            f"{self._daq.device}/{encoder.terminal}",
            decoding_type=EncoderType.X_4,
            zidx_enable=encoder.index,
            units=AngleUnits.TICKS,
            pulses_per_rev=max(1, round(encoder.counts_per_turn / 4.0)),
        )
        for wire, terminal in (("a", encoder.a), ("b", encoder.b), ("z", encoder.z)):
            if terminal:
                setattr(channel, f"ci_encoder_{wire}_input_term", f"/{self._daq.device}/{terminal}")
            if encoder.filter_time > 0.0 and (wire != "z" or encoder.index):
                setattr(channel, f"ci_encoder_{wire}_input_dig_fltr_min_pulse_width", encoder.filter_time)
                setattr(channel, f"ci_encoder_{wire}_input_dig_fltr_enable", True)
        self._time(task, self._shared_clock)

    def _add_output(self, task: Any) -> None:
        add_output(task, self._daq)
        if self.single_point:
            self._time(task, self._shared_clock)

    def _add_enable(self, task: Any) -> None:
        add_enable(task, self._daq)

    def _add_dead_man(self, task: Any) -> None:
        task.do_channels.add_do_chan(f"{self._daq.device}/{self._daq.dead_man.terminal}")

    def _add_lines(self, task: Any) -> None:
        for _, line in self._inputs:
            task.di_channels.add_di_chan(f"{self._daq.device}/{line.terminal}")

    @property
    def _shared_clock(self) -> str:
        return f"/{self._daq.device}/ai/SampleClock" if self.present else ""

    def _time(self, task: Any, source: str) -> None:
        from nidaqmx.constants import AcquisitionType

        # ASSUMPTION paced-by-the-card: in single-point mode the blocking read is what paces the loop.
        mode = AcquisitionType.HW_TIMED_SINGLE_POINT if self.single_point else AcquisitionType.CONTINUOUS
        task.timing.cfg_samp_clk_timing(
            self._daq.rate_hz,
            source=source,
            sample_mode=mode,
            samps_per_chan=round(BUFFER_SECONDS * self._daq.rate_hz),
        )

    def _bind(self) -> None:
        """Readers and writers; a ``Task.read`` costs a dozen calls, these one each."""
        from nidaqmx.stream_readers import AnalogMultiChannelReader, CounterReader, DigitalMultiChannelReader
        from nidaqmx.stream_writers import AnalogSingleChannelWriter, DigitalSingleChannelWriter

        counter = CounterReader(self.counter.in_stream)
        counter.verify_array_shape = False
        output = AnalogSingleChannelWriter(self.output.out_stream, auto_start=not self.single_point)
        self._enable_writer = DigitalSingleChannelWriter(self.enable.out_stream, auto_start=True)
        if self.dead_man is not None:
            self._beat_writer = DigitalSingleChannelWriter(self.dead_man.out_stream, auto_start=True)
        if self.lines is not None:
            self._lines_reader = DigitalMultiChannelReader(self.lines.in_stream)
            self._lines_reader.verify_array_shape = False
            self._levels = np.zeros(len(self._inputs), dtype=bool)
        self.write_volts: Callable[[float], None] = output.write_one_sample
        self.read_count: Callable[[float], float] = counter.read_one_sample_double
        self.read_counts = counter.read_many_sample_double
        self._clock_stream = (self.inputs or self.counter).in_stream
        if self.inputs is not None:
            analog = AnalogMultiChannelReader(self.inputs.in_stream)
            analog.verify_array_shape = False
            self.read_volts = analog.read_one_sample
            self.read_blocks = analog.read_many_sample
        # The driver's own interpreter takes C-contiguous arrays only.
        self.volts = np.zeros(len(self.present))
        self.block_volts = np.zeros((len(self.present), self._daq.block))
        self.block_counts = np.zeros(self._daq.block)

    def _commit(self) -> None:
        """Reserve now: a refusal comes at opening, not when the motor is to move."""
        from nidaqmx.constants import TaskMode

        for task in self._open:
            if not (self.counted_on and task is self.counter):
                task.control(TaskMode.TASK_COMMIT)


def add_analog_input(task: Any, daq: Daq, k: int) -> None:
    """Add the ``k``-th raw channel to a task."""
    from nidaqmx.constants import TerminalConfiguration

    wiring = {
        "default": TerminalConfiguration.DEFAULT,
        "rse": TerminalConfiguration.RSE,
        "nrse": TerminalConfiguration.NRSE,
        "diff": TerminalConfiguration.DIFF,
        "pseudodiff": TerminalConfiguration.PSEUDO_DIFF,
    }
    channel = daq.inputs[k]
    task.ai_channels.add_ai_voltage_chan(
        f"{daq.device}/{channel.terminal}",
        terminal_config=wiring[channel.wiring],
        min_val=channel.low,
        max_val=channel.high,
    )


def add_output(task: Any, daq: Daq) -> None:
    """Add the amplifier's set value to a task."""
    task.ao_channels.add_ao_voltage_chan(
        f"{daq.device}/{daq.command.terminal}", min_val=daq.command.low, max_val=daq.command.high
    )


def add_enable(task: Any, daq: Daq) -> None:
    """Add the enable line to a task."""
    task.do_channels.add_do_chan(f"{daq.device}/{daq.enable.terminal}")


def signed_counts(counts: float) -> float:
    """Counts of a 32-bit counter that may have turned below zero."""
    return counts - 2.0 * _HALF_RANGE if counts >= _HALF_RANGE else counts


def whole_rows(block: Any, read: int) -> bool:
    """Whether the first ``read`` columns of a block that was filled with NaN hold the samples.

    After a partial read the driver's manual does not say where the samples of the second channel begin;
    a block of which this cannot be told is not believed.
    """
    return not np.isnan(block[:, :read]).any() and bool(np.isnan(block[:, read:]).all())


def packed(block: Any, read: int) -> Any | None:
    """The samples of a partly read block, shape (channels, read), or None where they cannot be told apart."""
    channels = block.shape[0]
    if whole_rows(block, read):
        return block[:, :read].copy()
    flat = block.reshape(-1)
    if not np.isnan(flat[: channels * read]).any() and np.isnan(flat[channels * read :]).all():
        return flat[: channels * read].reshape(channels, read).copy()
    return None


class ReadyStop:
    """Fresh tasks for the stop, and the way to a reset, made before they are needed: each costs calls.

    A task that is configured and not yet reserved takes nothing from anybody. Raises (at construction)
    DeviceLost, DeviceFault.
    """

    def __init__(self, connection: Connection, daq: Daq) -> None:
        self._connection, self._daq = connection, daq
        with answering(connection.where):
            self._enable, self._output = connection.task("stop-enable"), connection.task("stop-output")
            add_enable(self._enable, daq)
            add_output(self._output, daq)
            self._device = connection.system().devices[daq.device]

    def write(self) -> bool:
        """Stop, once; whoever holds the terminals loses them. Whether it went well; never raises."""
        from nidaqmx.errors import Error

        try:
            try:
                _drop(self._enable, self._daq)
                _write_zero(self._output)
            except Error:
                self._device.reset_device()
                return False  # the terminals are free now, and as at power-up: write to them anew
            return True
        except Error:
            return False
        finally:
            for task in (self._enable, self._output):
                with suppress(Error):
                    task.close()


def write_safe(connection: Connection, daq: Daq, reset: bool) -> tuple[DeviceFault, ...]:
    """Drop the enable line and write 0 V; what the driver refused, nothing where it confirmed both.

    The caller's timed tasks must have been given back: they hold the terminals.

    Args:
        reset: where a task that nobody gave back (a lost process, another program) still holds the
            terminals, reset the card, which frees it and brings its outputs to their power-up state: a
            motor that may move counts for more than another's measurement.

    Raises:
        DeviceLost: nobody there to be asked; every further attempt would only wait.
    """
    # ASSUMPTION late-write-is-lost: a timed task's own output cannot be trusted once its clock stops, and
    # stopping it may leave the last value standing. Hence fresh tasks.
    # ASSUMPTION fresh-task-reaches-the-output.
    refused = _both(connection, daq)
    if refused and reset:
        with suppress(DeviceFault):
            _reset(connection, daq)
        refused = _both(connection, daq)
    return refused


def _both(connection: Connection, daq: Daq) -> tuple[DeviceFault, ...]:
    refused = []
    for purpose, write in (("stop-enable", _lower), ("stop-output", _zero)):
        try:
            _write_once(connection, daq, purpose, write)
        except DeviceFault as fault:
            refused.append(fault)
    return tuple(refused)


def _write_once(connection: Connection, daq: Daq, purpose: str, write: Callable[[Any, Daq], None]) -> None:
    """Let ``write`` do its work on a fresh task of its own."""
    from nidaqmx.errors import Error

    task = connection.task(purpose)
    try:
        write(task, daq)
    except Error as error:
        raise translated(error, connection.where) from error
    finally:
        with suppress(Error):  # what was written stands
            task.close()


def _zero(task: Any, daq: Daq) -> None:
    add_output(task, daq)
    _write_zero(task)


def _write_zero(task: Any) -> None:
    from nidaqmx.stream_writers import AnalogSingleChannelWriter

    AnalogSingleChannelWriter(task.out_stream, auto_start=True).write_one_sample(0.0)


def _lower(task: Any, daq: Daq) -> None:
    add_enable(task, daq)
    _drop(task, daq)


def _drop(task: Any, daq: Daq) -> None:
    from nidaqmx.stream_writers import DigitalSingleChannelWriter

    writer = DigitalSingleChannelWriter(task.out_stream, auto_start=True)
    writer.write_one_sample_one_line(not daq.enable.active_high)


def _reset(connection: Connection, daq: Daq) -> None:
    from nidaqmx.errors import Error

    try:
        connection.system().devices[daq.device].reset_device()
    except Error as error:
        raise translated(error, connection.where) from error
