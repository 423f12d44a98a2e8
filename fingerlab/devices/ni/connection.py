"""The way to the driver: that of this machine, or an NI gRPC device server named in the rig file."""

from __future__ import annotations

import itertools
import os
import warnings
from typing import Any

from fingerlab.devices.ni.errors import answering
from fingerlab.rig.daq import Daq

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
        _quiet_warnings()
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


def _quiet_warnings() -> None:
    """Show a driver's warning once, not at every cycle: printing would make the loop later still."""
    from nidaqmx.errors import DaqWarning

    warnings.filterwarnings("once", category=DaqWarning)
