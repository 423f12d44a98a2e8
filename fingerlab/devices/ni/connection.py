"""The way to the driver: that of this machine, or an NI gRPC device server named in the rig file."""

from __future__ import annotations

import itertools
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from fingerlab.devices.protocol import DeviceFault, DeviceLost
from fingerlab.rig.daq import Daq

SAMPLES_NOT_YET_AVAILABLE = -200284

FAULTS: dict[int, str] = {
    -200279: "The card has overwritten samples that the program had not read; close other programs and "
    "start again.",
    -200284: "A sample did not come in time, as if the sample clock stood still; check the terminals in "
    "the rig file's [daq] and start again.",
    -200010: "The card's input memory has overflowed because the computer took its samples too slowly; close "
    "other programs and start again.",
    -200361: "The card's own input memory has overflowed because the bus to the computer was too slow; use a "
    "slot or port of its own and start again.",
    -209829: "The card's input buffer has overflowed on its way to the computer; lower the sample rate or "
    "close other programs, and start again.",
    -200714: "The driver could not move the samples to memory fast enough and has stopped the recording; "
    "close other programs and start again.",
    -209800: "The program read a sample only after the next one was due; close other programs, or set "
    "timing = 'buffered' in the rig file's [daq].",
    -209801: "The program wrote the motor's command only after its cycle had begun; close other programs, or "
    "set timing = 'buffered' in the rig file's [daq].",
    -209802: "The program has missed a cycle of the sample clock; close other programs, or set "
    "timing = 'buffered' in the rig file's [daq].",
    -209803: "The program has missed three or more cycles of the sample clock; close other programs, "
    "or set timing = 'buffered' in the rig file's [daq].",
    -200843: "The program read a sample three or more cycles late; close other programs, or set "
    "timing = 'buffered' in the rig file's [daq].",
    -201027: "The program has missed three or more cycles of the sample clock at once; close other programs, "
    "or set timing = 'buffered' in the rig file's [daq].",
    -200820: "The card takes only an even number of analog inputs in single-point mode; add or remove one in "
    "the rig file's [daq], or set timing = 'buffered'.",
    -50103: "The card is in use by another program or another session; close that one, or reset the card in "
    "NI MAX, and open it again.",
    -200022: "A part of the card (a clock, a counter, a route) is in use by another program; close that one "
    "and open the card again.",
    -200587: "The digital line for the amplifier's enable is in use by another program; close that one and "
    "open the card again.",
    -200089: "A task of the same name exists already on the card; close the other program and open the card "
    "again.",
    -200170: "The card has no such terminal; correct the terminals in the rig file's [daq].",
    -200077: "The card does not support a setting that it was asked for; correct the rig file's [daq].",
    -200474: "The card did not finish in time; start again.",
}
"""Codes after which the same card may be tried again."""

RESET = (
    "The card was removed, or reset by hand or by another program, while it was running; close such a "
    "program, check the card and open it again."
)
"""Which of them, the driver does not tell."""

LOSSES: dict[int, str] = {
    -200220: "The driver knows no card of that name; correct 'device' in the rig file's [daq] or plug it in.",
    -201003: "The card cannot be reached, as if unplugged or without power; check it and open it again.",
    -200324: "The card is absent or its driver is not loaded; check it and open it again.",
    -50405: "The transfer from the card has broken off, as if it was unplugged; check it and open it again.",
    -88709: RESET,
    -88710: RESET,
    -200088: f"The card no longer knows the running task. {RESET}",
}
"""Codes after which the card has to be opened anew."""

UNSUPPORTED = frozenset(
    {
        -209857,  # the device does not support hardware-timed single points
        -200821,  # nor its analog inputs
        -200820,  # an odd number of them
        -200998,  # nor its counters, for this measurement
        -201116,  # nor its analog outputs
        -201025,
        -201410,  # not at this rate
        -200077,  # invalid value of an attribute
        -200197,  # attribute not supported,
        -200452,  # or not in this task
        -200431,  # the terminal does not do this
    }
)
"""Codes by which a device says that it cannot do hardware-timed single points (``nidaqmx.error_codes``)."""


def code_of(error: Exception) -> int | None:
    """The driver's error code, where the error has one."""
    code = getattr(error, "error_code", None)
    return None if code is None else int(code)


def translated(error: Exception, where: str) -> DeviceLost | DeviceFault:
    """An error of ``nidaqmx`` as the failure that the control loop knows.

    Args:
        error: any ``nidaqmx.errors.Error``; ``RpcError`` and ``DaqNotFoundError`` are no ``DaqError``.
        where: name of the card or server, which opens the sentence.
    """
    from nidaqmx import errors

    code = code_of(error)
    if code is not None:
        if code in LOSSES:
            return DeviceLost(f"{where}: {LOSSES[code]} (NI-DAQmx {code})")
        if code in FAULTS:
            return DeviceFault(f"{where}: {FAULTS[code]} (NI-DAQmx {code})")
        return DeviceFault(f"{where}: NI-DAQmx reports error {code}: {_first_sentence(error)}")
    if isinstance(error, errors.RpcError):
        return _of_the_server(error, where)
    if isinstance(error, errors.DaqNotFoundError | errors.DaqNotSupportedError):
        return DeviceLost(
            f"{where}: no NI-DAQmx driver on this machine ({_first_sentence(error)}); install it, or name a "
            "device server in the rig file's [daq]."
        )
    return DeviceFault(f"{where}: {_first_sentence(error)}")


@contextmanager
def answering(where: str) -> Iterator[None]:
    """Turn what the driver raises inside into DeviceLost or DeviceFault."""
    from nidaqmx import errors

    try:
        yield
    except errors.Error as error:
        raise translated(error, where) from error


def _of_the_server(error: Exception, where: str) -> DeviceLost | DeviceFault:
    import grpc

    code = getattr(error, "rpc_code", None)
    if code == grpc.StatusCode.UNIMPLEMENTED:
        return DeviceFault(f"{where}: the device server is too old for this program; update it.")
    if code == grpc.StatusCode.DEADLINE_EXCEEDED:
        why = "did not answer in time"
    elif code == grpc.StatusCode.UNAVAILABLE:
        why = "does not answer"
    else:
        why = f"has failed ({_first_sentence(error)})"
    return DeviceLost(
        f"{where}: the device server {why}; check that it runs and the network, and open it again."
    )


def _first_sentence(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].strip().rstrip(".") if lines else type(error).__name__


RPC_DEADLINE = 1.0
"""s; a server that takes longer counts as lost, or a pulled network cable would hang the loop for minutes."""

_numbers = itertools.count(1)


class Connection:
    """Makes tasks, and asks the driver.

    Args:
        daq: names the server, if any. The connection is neither encrypted nor authenticated: for a
            network of the laboratory's own.
        channel: a gRPC channel to use instead, for tests and for channels with TLS.
    """

    def __init__(self, daq: Daq, channel: Any = None) -> None:
        self._server = daq.server
        self._given = channel
        self._channel: Any = None
        self.where = daq.device if not daq.server else f"{daq.device} at {daq.server}"
        self.remote = bool(daq.server) or channel is not None

    def task(self, purpose: str) -> Any:
        """A new, empty task with a name that no other session has.

        Raises:
            DeviceLost, DeviceFault: no driver, or no server.
        """
        import nidaqmx

        # The driver refuses a name that is taken, and a server would hand over another session's task.
        name = f"fingerlab-{purpose}-{os.getpid()}-{next(_numbers)}"
        with answering(self.where):
            return nidaqmx.Task(name, grpc_options=self._options(name))

    def system(self) -> Any:
        """The driver's view of itself. With a dead server this succeeds: ask it for something real."""
        from nidaqmx.system import System

        with answering(self.where):
            return System.remote(self._options("")) if self.remote else System.local()

    def close(self) -> None:
        """Close the channel, if it is one of our own. Never raises."""
        channel, self._channel = self._channel, None
        if channel is not None and self._given is None:
            channel.close()

    def _options(self, name: str) -> Any:
        # A warning is shown once, not at every cycle: printing would make the loop later still.
        from nidaqmx.errors import DaqWarning

        warnings.filterwarnings("once", category=DaqWarning)
        if not self.remote:
            return None
        from nidaqmx.grpc_session_options import GrpcSessionOptions, SessionInitializationBehavior

        if self._channel is None:
            self._channel = self._given if self._given is not None else open_channel(self._server)
        never_attach = SessionInitializationBehavior.INITIALIZE_SERVER_SESSION
        return GrpcSessionOptions(self._channel, name, initialization_behavior=never_attach)


class DeadlineChannel:
    """A gRPC channel whose calls fail after a while instead of waiting for ever."""

    def __init__(self, channel: Any, seconds: float) -> None:
        self._channel = channel
        self._seconds = seconds

    def unary_unary(self, *args: Any, **kwargs: Any) -> Any:
        """As ``grpc.Channel.unary_unary``."""
        call, seconds = self._channel.unary_unary(*args, **kwargs), self._seconds
        return lambda request, metadata=None: call(request, timeout=seconds, metadata=metadata)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._channel, name)


def open_channel(server: str) -> DeadlineChannel:
    """A channel to ``host:port``; whether anybody is there shows at the first call."""
    import grpc

    options = [("grpc.keepalive_time_ms", 1000), ("grpc.keepalive_timeout_ms", 1000)]
    return DeadlineChannel(grpc.insecure_channel(server, options=options), RPC_DEADLINE)
