"""What there is to drive, and which device to use, as plain values that another process can build."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fingerlab.core.errors import UserError
from fingerlab.devices.clock import Clock, RealClock
from fingerlab.devices.faults import Faults
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost, FoundDevice
from fingerlab.rig.constants import Rig
from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import default_rig

if TYPE_CHECKING:
    from fingerlab.devices.simulated import Simulation

SIMULATED = "simulated"
INSTEAD = "using the simulated rig"


def detect(rig: Rig | None = None, channel: Any = None) -> tuple[FoundDevice, ...]:
    """The card that the rig file names, then the simulated rig; whether each can be used, and why not.

    Takes a quarter of a second where ``nidaqmx`` has to be loaded, and up to a few seconds where a device
    server is named that does not answer. Never raises.

    Args:
        rig: names card and server; the default rig where it is None.
        channel: a gRPC channel instead of the rig's server, for tests.
    """
    return _card(rig, channel), _simulated()


def opening_sentence(found: tuple[FoundDevice, ...]) -> str:
    """The line that the window and the command line show at the start."""
    card = found[0]
    if card.available or any(one.available for one in found):
        return card.sentence
    return " ".join(one.sentence for one in found)


def _card(rig: Rig | None, channel: Any) -> FoundDevice:
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
            return FoundDevice(name, False, f"no NI-DAQmx driver: {INSTEAD} ({_short(error)})")
        except nidaqmx.errors.DaqNotSupportedError as error:
            return FoundDevice(name, False, f"no NI-DAQmx driver: {INSTEAD} ({_short(error)})")
        except (nidaqmx.errors.RpcError, DeviceLost) as error:
            return FoundDevice(name, False, _not_there(daq.server, error))
        finally:
            connection.close()
    except UserError as error:
        return FoundDevice(name, False, f"{_short(error)}: {INSTEAD}")
    except ImportError as error:
        return FoundDevice(
            name, False, f"no NI-DAQmx driver: {INSTEAD} (nidaqmx cannot be loaded: {_short(error)})"
        )
    except Exception as error:  # a driver may fail in any way; the window has to open all the same
        return FoundDevice(name, False, f"the NI-DAQmx driver failed: {INSTEAD} ({_short(error)})")


def _ask(connection: Any, name: str) -> FoundDevice:
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
        return FoundDevice(name, False, f"the NI-DAQmx driver knows no card {where} ({known}): {INSTEAD}")
    device = system.devices[name]
    product = str(device.product_type)
    if device.is_simulated:
        return FoundDevice(
            name,
            False,
            f"{where} ({product}) is a simulated device of NI MAX, whose encoder stands still: {INSTEAD}",
        )
    return FoundDevice(name, True, f"{where}: {product}, serial number {int(device.serial_num):X}")


def _not_there(server: str, error: Exception) -> str:
    place = f"the device server {server}" if server else "the device server"
    return f"{place} does not answer: {INSTEAD} ({_short(error)})"


def _simulated() -> FoundDevice:
    try:
        import fingerlab.twin.streaming  # noqa: F401 - whether the compiler is there
    except Exception as error:  # numba on a processor or a Python that it does not know
        return FoundDevice(SIMULATED, False, f"the simulated rig cannot be used ({_short(error)})")
    return FoundDevice(SIMULATED, True, "the simulated rig, as fast as the clock of this machine")


def _short(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0].strip().rstrip(".") if lines else type(error).__name__


REPLAY = "replay"
CARD = "card"
OWN = "own"


@dataclass(frozen=True)
class DeviceChoice:
    """A device before it is built; can be pickled.

    Attributes:
        kind: ``card``, ``simulated``, ``replay`` or ``own``.
        rig: whose wiring is used; for the simulated rig None means its own, a replay has its session's.
        simulation, faults: of the simulated rig. session, run: of a replay. file: of an own device.
        real_time: paced by the machine's clock, else as fast as possible (simulated rig and replay).
    """

    kind: str
    rig: Rig | None = None
    simulation: Simulation | None = None
    faults: Faults = field(default_factory=Faults)
    session: Path | None = None
    run: str | None = None
    real_time: bool = True
    file: Path | None = None

    @property
    def simulated(self) -> bool:
        """Whether nothing real moves, so that a program may answer in a person's place."""
        return self.kind == SIMULATED

    def build(self, clock: Clock | None = None) -> Device:
        """The device, not yet open.

        Args:
            clock: instead of the machine's, for tests.

        Raises:
            UserError: the session, preset or wiring is impossible.
        """
        pace = clock or (RealClock() if self.real_time else None)
        if self.kind == CARD:
            from fingerlab.devices.ni.card import NiCard

            return NiCard(self.rig or default_rig(), clock)
        if self.kind == REPLAY:
            from fingerlab.devices.replay import Replay

            if self.session is None:
                raise UserError("A replay needs a session file; give replay:FILE or replay:FILE#RUN.")
            return Replay(self.session, self.run, pace)
        if self.kind == OWN:
            from fingerlab.devices.own import own_device

            if self.file is None:
                raise UserError("A device of your own needs its Python file; give own:FILE.")
            return own_device(self.file, (self.rig or default_rig()).daq.rate_hz)
        from fingerlab.devices.simulated import SimulatedRig

        return SimulatedRig(self.rig, self.simulation, self.faults, pace)


def choose_device(
    name: str | None,
    rig: Rig | None = None,
    simulation: Simulation | None = None,
    real_time: bool = True,
    faults: Faults | None = None,
) -> DeviceChoice:
    """The device that a name of the command line or of the window means.

    Args:
        name: ``simulated``; ``replay:FILE`` or ``replay:FILE#RUN``; the name of a card (``Dev1``, or
            ``host:port/Dev1`` behind a device server); ``own:FILE`` for a device of one's own; None for the
            first one that is found.
        rig: names the card, its terminals and scaling; the default rig where it is None.
        faults: of the simulated rig.

    Raises:
        UserError: the name means nothing.
    """
    if name is None:
        found = next((one for one in detect(rig) if one.available), None)
        if found is None:
            raise UserError("No device can be used, not even the simulated rig; reinstall FingerLab.")
        name = found.name
    if name == SIMULATED:
        return DeviceChoice(SIMULATED, rig, simulation, faults or Faults(), real_time=real_time)
    if name.startswith(f"{REPLAY}:"):
        path, _, run = name.removeprefix(f"{REPLAY}:").partition("#")
        if not path:
            raise UserError("A replay needs a session file; give replay:FILE or replay:FILE#RUN.")
        return DeviceChoice(REPLAY, session=Path(path), run=run or None, real_time=real_time)
    if name.startswith(f"{OWN}:"):
        file = Path(name.removeprefix(f"{OWN}:"))
        if not file.name:
            raise UserError("A device of your own needs its Python file; give own:FILE.")
        choice = DeviceChoice(OWN, rig or default_rig(), file=file.resolve())
        choice.build()  # what is wrong with the file is said here, and not in the loop's process
        return choice
    server, slash, card = name.rpartition("/")
    if not card or (slash and ":" not in server):
        raise UserError(
            f"There is no device {name!r}; give 'simulated', 'replay:FILE', or a card such as 'Dev1' or "
            "'host:31763/Dev1'."
        )
    return DeviceChoice(CARD, _naming(rig or default_rig(), card, server if slash else None))


def _naming(rig: Rig, card: str, server: str | None) -> Rig:
    """The rig with another card; another server only where one is named."""
    daq = replace(rig.daq, device=card, server=rig.daq.server if server is None else server)
    extra: dict[str, Any] = {**rig.extra, "daq": plain_section(daq)}
    return replace(rig, extra=extra)
