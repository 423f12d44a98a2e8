"""Bringing the bench to rest: 0 V and the enable line low, by tasks that no clock can hold up."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from fingerlab.devices.ni.connection import Connection, answering, translated
from fingerlab.devices.ni.tasks import add_enable, add_output
from fingerlab.devices.protocol import DeviceFault
from fingerlab.rig.daq import Daq


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
