"""What there is to drive, in plain sentences; absence is normal and never an error."""

from __future__ import annotations

from typing import Any

from fingerlab.core.errors import UserError
from fingerlab.devices.protocol import DeviceFault, DeviceLost, Found
from fingerlab.rig.constants import Rig
from fingerlab.rig.file import default_rig

SIMULATED = "simulated"
INSTEAD = "using the simulated rig"


def detect(rig: Rig | None = None, channel: Any = None) -> tuple[Found, ...]:
    """The card that the rig file names, then the simulated rig; whether each can be used, and why not.

    Takes a quarter of a second where ``nidaqmx`` has to be loaded, and up to a few seconds where a device
    server is named that does not answer. Never raises.

    Args:
        rig: names card and server; the default rig where it is None.
        channel: a gRPC channel instead of the rig's server, for tests.
    """
    return _card(rig, channel), _simulated()


def opening_sentence(found: tuple[Found, ...]) -> str:
    """The line that the window and the command line show at the start."""
    card = found[0]
    if card.available or any(one.available for one in found):
        return card.sentence
    return " ".join(one.sentence for one in found)


def _card(rig: Rig | None, channel: Any) -> Found:
    name = "card"
    try:
        daq = (rig or default_rig()).daq
        name = daq.device
        import nidaqmx.errors

        from fingerlab.devices.ni.connection import Connection

        connection = Connection(daq, channel)
        try:
            return _ask(connection, name)
        except nidaqmx.errors.DaqNotFoundError as error:
            return Found(name, False, f"no NI-DAQmx driver: {INSTEAD} ({_short(error)})")
        except nidaqmx.errors.DaqNotSupportedError as error:
            return Found(name, False, f"no NI-DAQmx driver: {INSTEAD} ({_short(error)})")
        except (nidaqmx.errors.RpcError, DeviceLost) as error:
            return Found(name, False, _not_there(daq.server, error))
        finally:
            connection.close()
    except UserError as error:
        return Found(name, False, f"{_short(error)}: {INSTEAD}")
    except ImportError as error:
        return Found(
            name, False, f"no NI-DAQmx driver: {INSTEAD} (nidaqmx cannot be loaded: {_short(error)})"
        )
    except Exception as error:  # a driver may fail in any way; the window has to open all the same
        return Found(name, False, f"the NI-DAQmx driver failed: {INSTEAD} ({_short(error)})")


def _ask(connection: Any, name: str) -> Found:
    """Ask the driver for something real: with a dead server, ``System.remote`` itself succeeds."""
    try:
        system = connection.system()
    except (DeviceLost, DeviceFault) as failure:
        if failure.__cause__ is not None:
            raise failure.__cause__ from None
        raise
    names = list(system.devices.device_names)
    where = connection.where
    if name not in names:
        known = f"it knows {', '.join(names)}" if names else "it knows none"
        return Found(name, False, f"the NI-DAQmx driver knows no card {where} ({known}): {INSTEAD}")
    device = system.devices[name]
    product = str(device.product_type)
    if device.is_simulated:
        return Found(
            name,
            False,
            f"{where} ({product}) is a simulated device of NI MAX, whose encoder stands still: {INSTEAD}",
        )
    return Found(name, True, f"{where}: {product}, serial number {int(device.serial_num):X}")


def _not_there(server: str, error: Exception) -> str:
    place = f"the device server {server}" if server else "the device server"
    return f"{place} does not answer: {INSTEAD} ({_short(error)})"


def _simulated() -> Found:
    try:
        import fingerlab.twin.streaming  # noqa: F401 - whether the compiler is there
    except Exception as error:  # numba on a processor or a Python that it does not know
        return Found(SIMULATED, False, f"the simulated rig cannot be used ({_short(error)})")
    return Found(SIMULATED, True, "the simulated rig, as fast as the clock of this machine")


def _short(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].strip().rstrip(".") if lines else type(error).__name__
