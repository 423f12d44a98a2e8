"""Opening a bench, and what is on it: device, effect and fault; phase, cable and known load. No Qt.

Nothing of it is for the GUI thread.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fingerlab.acquisition.bench.bench import Bench
from fingerlab.acquisition.control.machine import Finish, SetUp, Start
from fingerlab.acquisition.protocols.steps import LIFT_S, Lift, lifting, plan_steps
from fingerlab.core.errors import UserError

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.steering import LoopSettings
    from fingerlab.acquisition.check_rig.walk import KeptCheck
    from fingerlab.core.trust import OwnSource
    from fingerlab.devices.choosing import DeviceChoice
    from fingerlab.devices.protocol import FoundDevice
    from fingerlab.rig.file import Rig


@dataclass(frozen=True)
class BenchRequest:
    """What the user chose.

    Attributes:
        device: as :func:`fingerlab.devices.choosing.choose_device` takes it. rig_file: None for the default.
        effect: of the simulated rig: empty for none, ``hidden``, or an effect's id. seed: which bench.
        preset: of the simulated rig. fault: of the simulated rig: empty for none, or one of
            :data:`fingerlab.devices.faults.FAULT_KINDS`; fault_after_s: how long after it starts.
        own: the file of an own device, as its user lets it be run.
        check: the bench is to be checked, step by step, not driven.
    """

    device: str
    rig_file: Path | None = None
    effect: str = ""
    seed: int = 0
    preset: str = "practice"
    fault: str = ""
    fault_after_s: float = 20.0
    own: OwnSource | None = None
    check: bool = False


@dataclass(frozen=True)
class ToCheck:
    """A bench that is to be checked.

    Attributes:
        source: of the rig, for the protocol. key: by ``walk.bench_key``. card: whether a card is checked.
        folder: where the result is kept; None for a rehearsal.
    """

    source: str
    key: str
    card: bool
    folder: Path | None


@dataclass(frozen=True)
class OpenBench:
    """A bench that runs.

    Attributes:
        rig: its own, with the calibrations of its folder in the wiring.
        attributes: for the session file: what a simulated bench says of itself, calibrations.
        calibrations: the rig folder; None where it has none, as a replay.
        simulated: whether nothing can be placed on it.
        checked: its last check; None where nothing real moves. to_check: what a check has to know of it; None
            where it was opened to be driven.
    """

    bench: Bench
    rig: Rig
    attributes: Mapping[str, Any] = field(default_factory=dict)
    calibrations: Path | None = None
    simulated: bool = False
    checked: KeptCheck | None = None
    to_check: ToCheck | None = None


OpenCall = Callable[[BenchRequest], OpenBench]
FindCall = Callable[[Path | None], "tuple[FoundDevice, ...]"]
MakeBench = Callable[["DeviceChoice", "LoopSettings", float], "Bench"]
"""Makes a device, its loop and its recorder, at a sampling rate in Hz."""


def in_processes(choice: DeviceChoice, settings: LoopSettings, rate_hz: float) -> Bench:
    """Loop and recorder in processes of their own."""
    from fingerlab.acquisition.bench.process_bench import ProcessBench
    from fingerlab.acquisition.recording import rescue_folder

    return ProcessBench(choice, settings, rescue_folder(), rate_hz)


def open_bench(wanted: BenchRequest, make: MakeBench = in_processes) -> OpenBench:
    """Build what was chosen.

    Raises:
        UserError: there is no such device, it does not answer, its user has not let its file be run, or a
            stored calibration is damaged.
    """
    from fingerlab.acquisition.bench.steering import LoopSettings
    from fingerlab.acquisition.check_rig.look import check_settings
    from fingerlab.acquisition.check_rig.walk import bench_key, checks_folder, last_check
    from fingerlab.acquisition.control.units import BenchUnits
    from fingerlab.calibration.store import default_folder, rig_and_attributes
    from fingerlab.devices.choosing import CARD, OWN, REPLAY, choose_device
    from fingerlab.devices.faults import fault_after
    from fingerlab.devices.protocol import SelfDescribing
    from fingerlab.devices.simulated import Simulation
    from fingerlab.rig.file import load_rig
    from fingerlab.twin.effects import parse_effects
    from fingerlab.twin.protocols import RATE_HZ

    if wanted.device.startswith(f"{OWN}:"):
        _let_run(wanted)  # before anything of the file is
    rig = load_rig(wanted.rig_file) if wanted.rig_file is not None else None
    hidden = wanted.effect == "hidden"
    effects = parse_effects(() if hidden or not wanted.effect else (wanted.effect,))
    simulation = Simulation(wanted.preset, wanted.seed, effects, hidden)
    faults = fault_after(wanted.fault, wanted.fault_after_s, RATE_HZ)
    choice = choose_device(wanted.device, rig, simulation, faults=faults)
    attributes: dict[str, Any] = {}
    wired = choice.kind in (CARD, OWN)
    if wired:
        assert choice.rig is not None
        known: Rig = choice.rig
        rate = known.daq.rate_hz
    else:  # built here, too, to be asked what it is; the loop's process builds its own
        device = choice.build()
        known = device.rig  # type: ignore[attr-defined]
        rate = device.rate_hz
        attributes = dict(device.session_attributes) if isinstance(device, SelfDescribing) else {}
    folder = None
    if choice.kind != REPLAY:  # what was recorded has the calibration of its time
        folder = default_folder(wanted.rig_file, "default" if wired else "simulated")
        known, calibration = rig_and_attributes(known, folder)
        attributes |= calibration
    settings = LoopSettings(BenchUnits.from_rig(known), known.limits)
    checked = to_check = None
    if wired:
        checked = last_check(known, bench_key(choice), checks_folder(wanted.rig_file))
        settings = replace(settings, current_share=checked.current_share())
        attributes["check_rig"] = checked.words
    if wanted.check:
        settings = check_settings(known)
        kept = checks_folder(wanted.rig_file) if wired else None
        source = str(wanted.rig_file or "the default rig")
        to_check = ToCheck(source, bench_key(choice), choice.kind == CARD, kept)
    bench = make(choice, settings, rate)
    return OpenBench(bench, known, attributes, folder, not wired, checked, to_check)


def _let_run(wanted: BenchRequest) -> None:
    """The file of an own device runs only with a content that its user was asked about."""
    from fingerlab.devices.choosing import confirm, device_file

    file = device_file(Path(wanted.device.partition(":")[2]))
    if wanted.own is not None and wanted.own.sha256 == file.sha256:
        confirm(file)
    elif file.state != "trusted":
        raise UserError(f"{file.path} was changed meanwhile; look at it again, and connect it anew.")


def own_device_file(path: Path) -> OwnSource | None:
    """A file to ask its user about; None where it cannot be read, which connecting it says."""
    from fingerlab.devices.choosing import device_file

    try:
        return device_file(path)
    except UserError:
        return None


def own_device_files() -> tuple[Path, ...]:
    """Files of own devices that were let in before; none where that is not known any more."""
    from fingerlab.devices.choosing import confirmed_files

    try:
        return confirmed_files()
    except UserError:  # said when one is connected
        return ()


def forget_own_device(path: Path) -> None:
    """Its file is asked about again before it is run.

    Raises:
        UserError: the settings cannot be read or written.
    """
    from fingerlab.devices.choosing import forget

    forget(path)


def find_devices(rig_file: Path | None) -> tuple[FoundDevice, ...]:
    """What can be used, with the sentence to show.

    Raises:
        UserError: the rig file cannot be read.
    """
    from fingerlab.acquisition.check_rig.walk import checks_folder, last_check
    from fingerlab.devices.choosing import CARD, detect
    from fingerlab.rig.file import default_rig, load_rig

    rig = load_rig(rig_file) if rig_file is not None else default_rig()
    card, *others = detect(rig)
    if card.available:
        words = last_check(rig, CARD, checks_folder(rig_file)).words
        card = replace(card, sentence=f"{card.sentence}; {words}")
    return card, *others


def effect_choices() -> tuple[tuple[str, str], ...]:
    """Id and title of every effect that the simulated rig can have."""
    from fingerlab.report.diagnosis_words import effect_title
    from fingerlab.twin.effects import EFFECTS

    return tuple(sorted(((name, effect_title(name)) for name in EFFECTS), key=lambda pair: pair[1]))


def fault_choices() -> tuple[tuple[str, str], ...]:
    """Id and title of every fault that the simulated rig can be given."""
    from fingerlab.devices.faults import FAULT_KINDS

    return tuple((name, kind.title) for name, kind in FAULT_KINDS.items())


def run_choices(path: Path) -> tuple[tuple[str, str], ...]:
    """Name of every run of a session that can be replayed, and what it is.

    Raises:
        UserError: it is no session.
    """
    from fingerlab.sessions import open_session
    from fingerlab.sessions.trajectory import trajectory_words

    session = open_session(path)
    radius = session.rig.line_radius
    return tuple(
        (
            run.name,
            f"Run {run.name}: {run.phase.replace('_', ' ')}, {trajectory_words(run.trajectory, radius)}",
        )
        for run in session.runs
    )


LOADED_PHASE = "motor_bench"
"""The phase that can have a known load."""


def changed_set_up(before: SetUp, **values: Any) -> SetUp:
    """A set-up whose cable goes with its phase, without a load where none can hang.

    Raises:
        UserError: phase and cable do not go together.
    """
    from fingerlab.twin.protocols import setup_of

    wanted = replace(before, **values)
    if "cable" not in values and "phase" in values:
        phase, cable = setup_of(wanted.phase)
    else:
        phase, cable = setup_of(wanted.phase, wanted.cable)
    load = wanted.load_torque if phase == LOADED_PHASE else 0.0
    return SetUp(phase, cable, load)


CABLE_REFUSALS = {
    "motor_bench": "The motor bench is without a cable.",
    "contact": "The fingertip is pressed with the flexion cable.",
}


def cable_refusal(set_up: SetUp, cable: str) -> str:
    """Why this cable does not go with the phase; empty where it does."""
    try:
        changed_set_up(set_up, cable=cable)
    except UserError:
        return CABLE_REFUSALS.get(
            set_up.phase, "A finger is moved by a cable; none goes with the motor bench."
        )
    return ""


def lift_before(set_up: SetUp, trajectory: Mapping[str, Any]) -> Lift | None:
    """How a run's known load is lifted off its support before the run, as in a protocol; None without one.

    Raises:
        UserError: the run would set the load down, or is no trajectory.
    """
    if not set_up.load_torque:
        return None
    from fingerlab.twin.protocols import RunPlan

    plan = RunPlan(set_up.phase, set_up.cable, trajectory, set_up.load_torque)
    return next((step for step in plan_steps([plan], 0.0) if isinstance(step, Lift)), None)


def lift_and_start(lift: Lift, start: Start) -> Callable[[Bench], None]:
    """Lifts the load, then starts; a start that is refused sets it down again."""

    def work(bench: Bench) -> None:
        bench.ask(lifting(lift))
        bench.wait(LIFT_S)
        try:
            bench.ask(start)
        except UserError:
            with suppress(UserError):  # stopped meanwhile: the first sentence says it
                bench.ask(Finish())
            raise

    return work
