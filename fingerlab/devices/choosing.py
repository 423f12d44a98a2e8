"""What there is to drive, own devices included, and which to use, as values that a process can build.

A file of one's own is run where it is named, and nowhere else: it moves a motor, and should have been read by
whoever names it. Who writes ``own:FILE`` in a command has named it; where it is chosen from a list, as in the
window, :func:`confirm` remembers that its user let exactly this content be run.
"""

from __future__ import annotations

import inspect
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from fingerlab.core import trust
from fingerlab.core.errors import UserError
from fingerlab.core.trust import (
    OwnSettings,
    OwnSource,
    State,
    confirmed_names,
    forget_file,
    read_settings,
    run_source,
    said,
    with_state,
    write_settings,
)
from fingerlab.devices.faults import Faults
from fingerlab.devices.protocol import Clock, Device, DeviceFault, DeviceLost, FoundDevice, RealClock
from fingerlab.rig.daq import plain_section
from fingerlab.rig.file import Rig, default_rig

if TYPE_CHECKING:
    from fingerlab.devices.simulated import Simulation

CALLS = ("open", "start", "set_enable", "exchange", "make_safe", "close")
"""What a class needs beside ``name`` and ``rate_hz`` to be taken for a device."""


def device_file(path: Path) -> OwnSource:
    """A file that is chosen; it is read, not run.

    Raises:
        UserError: it cannot be read, or the settings are damaged.
    """
    return with_state(_source(path), read_settings("devices"))


def confirm(file: OwnSource) -> None:
    """Remember that its user lets exactly this content be run. Call it only after they were asked.

    Raises:
        UserError: the settings cannot be read or written.
    """
    trust.confirm(file, "devices")


def confirmed_files() -> tuple[Path, ...]:
    """Files that were confirmed and are still there, latest first.

    Raises:
        UserError: the settings are damaged.
    """
    return tuple(path for path in map(Path, confirmed_names("devices")) if path.is_file())


def remembered_files() -> tuple[tuple[Path, State | Literal["missing"]], ...]:
    """Every file of which a content was ever confirmed, latest first: as it reads now.

    Raises:
        UserError: the settings are damaged.
    """
    paths = [Path(name) for name in confirmed_names("devices")]
    return tuple((path, device_file(path).state if path.is_file() else "missing") for path in paths)


def forget(path: Path) -> None:
    """Forget that this file was ever confirmed, whether it is still there or not.

    Raises:
        UserError: it never was, or the settings cannot be read or written.
    """
    if not forget_file(str(path.resolve()), "devices"):
        raise UserError(f"{path} was never confirmed as a device of your own; there is nothing to forget.")


def forget_all() -> None:
    """Forget every device of one's own."""
    write_settings(OwnSettings(), "devices")


def own_device(path: Path, rate_hz: float) -> Device:
    """The device of a file, not yet open.

    Args:
        path: of the Python file. rate_hz: cycles a second that the rig file gives.

    Raises:
        UserError: the file cannot be read or run, holds no device or several, or it runs at another rate.
    """
    kinds = [one for one in _classes(path) if all(callable(getattr(one, call, None)) for call in CALLS)]
    if len(kinds) != 1:
        found = ", ".join(one.__name__ for one in kinds) or "none"
        raise UserError(
            f"{path} should hold one class with {', '.join(CALLS)}, name and rate_hz; it holds {found}."
        )
    try:
        with redirect_stdout(sys.stderr):
            device = kinds[0]()
    except (Exception, SystemExit) as error:  # whatever the file does
        raise UserError(f"{kinds[0].__name__} of {path} cannot be made: {said(error)}.") from None
    if not isinstance(device, Device):
        raise UserError(f"{kinds[0].__name__} of {path} has no name or no rate_hz; add both.")
    if abs(device.rate_hz - rate_hz) > 1e-6 * rate_hz:
        raise UserError(
            f"{path} runs at {device.rate_hz:g} Hz and the rig file says {rate_hz:g} Hz; "
            "set rate_hz in its section [daq]."
        )
    return device


def _classes(path: Path) -> list[type]:
    """Classes that the file itself defines. It is run as it reads now, past what Python may have compiled."""
    name = f"fingerlab_own_device_{path.stem}"
    source = _source(path)
    try:
        module = run_source(source, name)
    except (Exception, SystemExit) as error:  # whatever the file does
        raise UserError(f"{path} cannot be run: {said(error)}.") from None
    return [one for _, one in inspect.getmembers(module, inspect.isclass) if one.__module__ == name]


def _source(path: Path) -> OwnSource:
    if not path.is_file():
        raise UserError(f"{path} does not exist; name the Python file of a device.")
    try:
        return OwnSource(str(path.resolve()), path.read_bytes())
    except OSError as error:
        raise UserError(
            f"{path} cannot be read ({error.strerror}); name the Python file of a device."
        ) from None


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
        except (nidaqmx.errors.DaqNotFoundError, nidaqmx.errors.DaqNotSupportedError) as error:
            return FoundDevice(name, False, f"no NI-DAQmx driver: {INSTEAD} ({_short(error)})", ())
        except (nidaqmx.errors.RpcError, DeviceLost) as error:
            return FoundDevice(name, False, _not_there(daq.server, error))
        finally:
            connection.close()
    except UserError as error:
        return FoundDevice(name, False, f"{_short(error)}: {INSTEAD}")
    except ImportError as error:
        return FoundDevice(
            name, False, f"no NI-DAQmx driver: {INSTEAD} (nidaqmx cannot be loaded: {_short(error)})", ()
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
    names = tuple(map(str, system.devices.device_names))
    where = connection.where
    if name not in names:
        known = f"it knows {', '.join(names)}" if names else "it knows none"
        return FoundDevice(
            name, False, f"the NI-DAQmx driver knows no card {where} ({known}): {INSTEAD}", names
        )
    device = system.devices[name]
    product = str(device.product_type)
    if device.is_simulated:
        return FoundDevice(
            name,
            False,
            f"{where} ({product}) is a simulated device of NI MAX, whose encoder stands still: {INSTEAD}",
            names,
        )
    return FoundDevice(name, True, f"{where}: {product}, serial number {int(device.serial_num):X}", names)


def _not_there(server: str, error: Exception) -> str:
    place = f"the device server {server}" if server else "the device server"
    return f"{place} does not answer: {INSTEAD} ({_short(error)})"


def _simulated() -> FoundDevice:
    try:
        import fingerlab.twin.recording  # noqa: F401 - whether the compiler is there
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


def refuse_unknown(choice: DeviceChoice, channel: Any = None) -> None:
    """Refuse a card that is known not to be there, such as a misspelt ``simulated``, and name what is.

    A server that does not answer and a driver that fails say so themselves where the card is opened.

    Args:
        choice: as somebody wrote it. channel: a gRPC channel instead of the rig's server, for tests.

    Raises:
        UserError: the driver lists no such card, or there is no driver at all.
    """
    if choice.kind != CARD:
        return
    daq = (choice.rig or default_rig()).daq
    names = _card(choice.rig, channel).listed
    if names is None or daq.device in names:
        return
    what = f"There is no device {daq.device!r}" + (f" at {daq.server}" if daq.server else "")
    if names:
        right = f"the NI-DAQmx driver lists {', '.join(names)}; give one of these"
    else:
        where = "there" if daq.server else "on this machine"
        right = f"no NI-DAQmx driver lists a card {where}; give the name of one that is plugged in"
        right += "" if daq.server else ", one behind a device server such as 'host:31763/Dev1'"
    raise UserError(f"{what}: {right}, {SIMULATED!r} or 'own:FILE.py'.")


def _naming(rig: Rig, card: str, server: str | None) -> Rig:
    """The rig with another card; another server only where one is named."""
    daq = replace(rig.daq, device=card, server=rig.daq.server if server is None else server)
    extra: dict[str, Any] = {**rig.extra, "daq": plain_section(daq)}
    return replace(rig, extra=extra)
