"""The control loop: one exchange with the device a cycle, and everything that follows from it.

The loop knows no window, no file and no wall clock: its time is the sample index over the rate. It runs in
a process of its own (``processes.py``) or is stepped on a virtual clock (``process_bench.py``), by one code.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from fingerlab.acquisition.bench.at_rest import (
    STOPPED_MEANWHILE,
    Averaging,
    beyond_its_range,
    move_by_hand,
    try_output,
)
from fingerlab.acquisition.bench.steering import (
    LoopSettings,
    ReadyStart,
    Refused,
    Steering,
    prepare,
    unguarded,
    watchdogs,
)
from fingerlab.acquisition.control.machine import (
    AtRest,
    Command,
    Disable,
    Enable,
    Event,
    Finish,
    HoldDeadMan,
    Initialise,
    Interlock,
    Machine,
    Mode,
    MoveByHand,
    Quit,
    Release,
    Reset,
    SetGains,
    SetUp,
    Tare,
    Winding,
)
from fingerlab.acquisition.control.plausibility import (
    SENSORS,
    lacking,
    safety_checks,
    sensors_of,
    window_fault,
)
from fingerlab.acquisition.control.safety import EncoderFault, Reading, Safety
from fingerlab.acquisition.control.units import Reader
from fingerlab.acquisition.ring import Publisher, Ring
from fingerlab.acquisition.status import SharedStatus, Slot, Text
from fingerlab.core.errors import UserError
from fingerlab.devices.protocol import (
    DeadMan,
    Device,
    DeviceFault,
    DeviceLost,
    ReadInBlocks,
    SetUpBySoftware,
    counted_on,
    cycles_per_command,
    safety_lines,
)

FAREWELL_S = 0.5
"""The loop goes on reading for this long after its window is lost, so that the stop is recorded (assumed)."""

STOOD_STILL = "The control loop stood still; the motor was stopped in its place, connect the device again."

SENSORS_S = 0.2
"""How often the sensors' volts are looked at while the amplifier is off."""

SAFE_TRIES = 50
"""How often zero output is tried before the device is given up."""


class ControlLoop:
    """Drives one device.

    Args:
        clock: seconds, for the measured cycle time only; None on a virtual clock.
    """

    def __init__(
        self,
        device: Device,
        settings: LoopSettings,
        ring: Ring,
        board: SharedStatus,
        clock: Callable[[], float] | None = None,
    ) -> None:
        self.device, self.settings = device, settings
        self.machine = Machine()
        self.ended = False
        self._board = board
        self._publisher = Publisher(ring, board, 1.0 / device.rate_hz)
        self._period = 1.0 / device.rate_hz
        self._reader = Reader(settings.units, self._period, clock)
        self._commands: deque[tuple[int, Command | ReadyStart | Refused]] = deque()
        self._averaging: Averaging | None = None
        self._enabling: int | None = None  # number of the enable that is answered once there is current
        self._lost_process = ""
        self._look: Callable[[], None] = lambda: None
        self._quit_at = math.inf
        self._restart = self._held = False
        self._stops = board[Slot.STOP_REQUESTS]
        self._recorder_errors = board[Slot.RECORDER_ERRORS]
        self._dogs = watchdogs(settings, self._period)
        self._faults = self._run = 0
        self._look_every, self._reported = max(1, round(SENSORS_S / self._period)), ""
        self._in_contact = False
        self._fit()
        self._safety: Safety
        self._sensors: tuple[int, ...]
        self._cable: bool
        self._set_up(SetUp())

    def open(self) -> None:
        """Open and start the device. Raises DeviceLost, DeviceFault."""
        self.device.open()
        self.device.start()
        self._fit()  # a card knows only now for how many samples a command stays
        self._board.set_text(Text.DEVICE, self.device.name)
        self._board[Slot.LOOP_READY] = 1

    def submit(self, number: int, command: Command) -> None:
        """Ask for something; answered in the board under ``number``. May be called from another thread."""
        self._commands.append((number, prepare(command, self.settings, self._cable)))

    def lose(self, sentence: str, farewell: bool) -> None:
        """Another process is gone. With ``farewell`` the loop ends soon. May be called from a thread."""
        if farewell:
            self._quit_at = min(self._quit_at, self._reader.index + FAREWELL_S / self._period)
        self._lost_process = sentence

    def run(self, look: Callable[[], None] = lambda: None) -> None:
        """Cycle until told to quit, ``look`` before each; the motor has no current afterwards."""
        self._look = look
        try:
            while not self.ended:
                look()
                self.cycle()
        except BaseException as error:
            self._fault(f"The control loop broke off ({type(error).__name__}: {error}).")
            raise
        finally:
            self.close()

    def close(self) -> None:
        """Zero output, enable low, device given back."""
        self.ended = True
        self._make_safe()
        self.device.close()
        self._become(Event.DISABLE)
        self._board[Slot.LOOP_ENDED] = 1

    def cycle(self) -> None:
        """One sample: read it, judge it, obey, steer, publish."""
        if self._restart and not self._start_again():
            return
        try:
            if self._beat is not None and self.machine.enable_allowed and not self._held:
                self._beat()
            sample = self.device.exchange(self._steering.volts)
        except DeviceLost as error:
            self._fault(str(error), lost=True)
            return
        except DeviceFault as error:
            taken = bool(self._board[Slot.GUARDIAN_ACTED])  # by the guardian: there is no device left
            self._fault(STOOD_STILL if taken else str(error), lost=taken)
            # A device that fails in every cycle must not keep the loop from its end.
            self.ended = self.ended or any(isinstance(one, Quit) for _, one in list(self._commands))
            return
        reading = self._reader.read(sample, self._steering.reference.value, self._commanded())
        reading.taking_up = self._steering.taking_up
        sentence = self._complaint(reading)
        if sentence:
            self._fault(sentence)
        self._obey(reading)
        self._steer(reading)
        run = self._run if self.machine.command_allowed else 0
        steering = self._steering
        self._publisher.publish(reading, self.machine, steering.reference.value, steering.amps, run)
        if reading.index >= self._quit_at:
            self.ended = True

    def _complaint(self, reading: Reading) -> str | None:
        """Why the motor may not go on, or None."""
        if self._lost_process:
            sentence, self._lost_process = self._lost_process, ""
            return sentence
        if self._board[Slot.GUARDIAN_ACTED]:
            self.ended = True
            return STOOD_STILL
        sentence = self._look_at_lines(reading)
        if sentence:
            return sentence
        errors = self._board[Slot.RECORDER_ERRORS]
        failed, self._recorder_errors = errors != self._recorder_errors, errors
        if not self.machine.enable_allowed:
            self._look_at_sensors(reading)
            return None
        if failed:
            return self._board.text(Text.RECORDER)
        for slot, dog in self._dogs:
            sentence = dog.fault(self._board[slot], reading.index) or ""
            if sentence:
                return sentence
        return self._safety.fault(reading) or self._steering.doubt(reading)

    def _commanded(self) -> float:
        """A that the amplifier is to make; NaN where nothing says that it can."""
        powered = self._board[Slot.ENABLE_LINE] and not self._held and not self._interlock.settling
        return self._steering.amps if powered else math.nan

    def _look_at_sensors(self, reading: Reading) -> None:
        """What is wrong with the volts of the sensors in use, for the board, while the amplifier is off."""
        if reading.index % self._look_every:
            return
        inputs = self.settings.units.inputs
        faults = (window_fault(SENSORS[k], inputs[k], reading.raw[k]) for k in self._sensors)
        sentence = next(filter(None, faults), "")
        if sentence[:20] != self._reported[:20]:  # told once, not anew with each volt
            self._reported = sentence
            self._board.set_text(Text.SENSORS, sentence)

    def _fit(self) -> None:
        """What depends on how the device takes its commands, and on the lines that it has."""
        hold, lines = cycles_per_command(self.device), safety_lines(self.device)
        self._steering = Steering(self.settings, self._period, hold, self._board)
        self._steering.in_contact = self._in_contact
        self._blocks = self.device if isinstance(self.device, ReadInBlocks) else None
        self._interlock = Interlock(lines, self._period, hold)
        self._beat: Callable[[], None] | None = None
        if lines.dead_man.terminal and isinstance(self.device, DeadMan):
            self._beat = self.device.beat
        self._board[Slot.DEAD_MAN] = int(self._beat is not None)

    def _look_at_lines(self, reading: Reading) -> str:
        """The digital inputs, for the board and the state machine; why the motor must stop, or nothing."""
        self._publisher.publish_lines(reading)
        change = self._interlock.look(reading, bool(self._board[Slot.ENABLE_LINE]))
        if change is not None:
            event, sentence = change
            self._become(event)
            return sentence
        if self._enabling is not None and not self._interlock.settling:
            number, self._enabling = self._enabling, None
            self._answer(number, "")
        return ""

    def _obey(self, reading: Reading) -> None:
        stops = self._board[Slot.STOP_REQUESTS]
        if stops != self._stops:
            self._stops = stops
            self._make_safe()
            self._become(Event.STOP)
            self._forget()
        if self._averaging is not None and self._averaging.add(reading):
            self._finish_averaging()
        while self._commands and self._averaging is None and self._enabling is None:
            number, command = self._commands.popleft()
            self._do(number, command, reading)

    def _steer(self, reading: Reading) -> None:
        """Set value for the next cycle."""
        steering = self._steering
        if not self.machine.command_allowed:
            steering.stand(reading.position)
            return
        if steering.advance(reading):
            if self.machine.mode is Mode.RUNNING:
                self._rest()
            elif self._steering.settled(reading.position):
                self._become(Event.REST)
        if self.machine.command_allowed:
            steering.command(reading, self._blocks is None or self._blocks.command_is_due)
        else:
            steering.off()

    def _do(self, number: int, command: Command | ReadyStart | Refused, reading: Reading) -> None:
        sentence = ""
        try:
            if isinstance(command, Refused):
                sentence = command.sentence
            elif isinstance(command, Initialise | Tare):
                sentence = self._begin_averaging(number, command)
                if not sentence:
                    return  # answered when the mean is taken
            elif isinstance(command, SetUp):
                sentence = self._set_up(command)
            elif isinstance(command, ReadyStart | Winding):
                sentence = self._start(command, reading)
            elif isinstance(command, SetGains):
                self._steering.change_gains(command, reading.position)
            elif isinstance(command, AtRest):
                sentence = self._at_rest(command)
            elif isinstance(command, HoldDeadMan):
                self._held = self._beat is not None
                sentence = "" if self._held else f"The {self.device.name} has no dead-man."
            elif isinstance(command, Quit):
                self.ended = True
            else:
                sentence = self._event(command)
                if not sentence and isinstance(command, Enable) and self._interlock.settling:
                    self._enabling = number
                    return  # answered when the amplifier has current
        except UserError as error:
            sentence = str(error)
        except DeviceLost as error:
            sentence = str(error)
            self._fault(sentence, lost=True)
        except DeviceFault as error:
            sentence = str(error)
            self._fault(sentence)
        self._answer(number, sentence)

    def _event(self, command: Command | ReadyStart | Refused) -> str:
        event = _EVENTS[type(command)]
        refusal = self.machine.refusal(event)
        if refusal:
            return refusal
        if isinstance(command, Enable):
            refusal = lacking(self._sensors, self.settings.units)
            refusal = refusal or unguarded(self.settings, self._board)
            refusal = refusal or beyond_its_range(self._reader.reading.position, self.settings.limits)
            if refusal:
                return refusal
            self._safety.reset()
            for _, dog in self._dogs:
                dog.reset()
            self._held = False
            self.device.set_enable(command.line)
            self._board[Slot.ENABLE_LINE] = int(command.line)
            if command.line:
                self._interlock.enabled(self._reader.index)
        elif event is Event.DISABLE:
            self._steering.off()
            self.device.set_enable(False)
            self._board[Slot.ENABLE_LINE] = 0
        elif event is Event.FINISH:
            self._rest()
            return ""
        elif event is Event.RESET:
            self._board.set_text(Text.FAULT, "")
        self._become(event)
        return ""

    def _start(self, command: ReadyStart | Winding, reading: Reading) -> str:
        refusal = self.machine.refusal(Event.RUN)
        if refusal:
            return refusal
        moving = self.machine.mode is Mode.RUNNING
        refusal = self._steering.start(command, reading.position, moving)
        if refusal:
            return refusal
        self._become(Event.RUN)
        self._run += 1
        self._board[Slot.RUN_START] = reading.index
        self._board[Slot.RUN] = self._run
        self._board[Slot.RUN_ACTIVE] = 1
        return ""

    def _rest(self) -> None:
        self._steering.rest(self._reader.reading.position)
        self._board[Slot.RUN_ACTIVE] = 0
        self._become(Event.FINISH)

    def _fault(self, sentence: str, lost: bool = False) -> None:
        """Motor off until the operator resets; with ``lost`` there is no device left, and the loop ends."""
        self.ended = self.ended or lost
        doubted = isinstance(sentence, EncoderFault)
        if not self._make_safe():
            sentence += " Zero output could not be confirmed: switch the amplifier off by hand."
        self._become(Event.FAULT)
        if doubted:
            self._become(Event.FORGET)
        self._forget(sentence)
        self._faults += 1
        self._board.set_text(Text.FAULT, sentence)
        self._board[Slot.FAULTS] = self._faults

    def _forget(self, why: str = STOPPED_MEANWHILE) -> None:
        """What was under way has ended; ``why`` answers an enable that was."""
        self._steering.forget()
        self._board[Slot.RUN_ACTIVE] = 0
        if self._averaging is not None:
            number, self._averaging = self._averaging.number, None
            self._answer(number, STOPPED_MEANWHILE)
        if self._enabling is not None:
            number, self._enabling = self._enabling, None
            self._answer(number, why)

    def _make_safe(self) -> bool:
        self._steering.off()
        confirmed = any(self.device.make_safe() for _ in range(1 + SAFE_TRIES))
        self._board[Slot.ENABLE_LINE] = 0
        self._board[Slot.SAFE] = int(confirmed)
        self._restart = True
        return confirmed

    def _start_again(self) -> bool:
        """After zero output the device's clock stands; set it going to see the bench again."""
        self._restart = False
        try:
            self.device.start()
        except (DeviceLost, DeviceFault) as error:
            self._fault(str(error), lost=True)
            return False
        counted = counted_on(self.device)
        self._reader.restarted(counted)
        if not counted:
            self._become(Event.FORGET)
        return True

    def _begin_averaging(self, number: int, command: Initialise | Tare) -> str:
        initialises = isinstance(command, Initialise)
        refusal = self.machine.refusal(Event.INITIALISE) if initialises else self.machine.tare_refusal
        if refusal:
            return refusal
        self._averaging = Averaging(number, command, self.settings, self._sensors, self._period)
        return ""

    def _finish_averaging(self) -> None:
        averaging, self._averaging = self._averaging, None
        assert averaging is not None
        sentence = averaging.finish(self._reader.zeros)
        if not sentence:
            self._board[Slot.SET_AT] = self._reader.index + 1
        if not sentence and isinstance(averaging.what, Initialise):
            self._become(Event.INITIALISE)
            self._reader.forget_speed()
        self._answer(averaging.number, sentence)

    def _set_up(self, command: SetUp) -> str:
        if self.machine.enable_allowed:
            return "The amplifier is enabled; disable it before the cable or the mode is changed."
        if isinstance(self.device, SetUpBySoftware) and self._reader.index >= 0:
            change = (command.intervention,) if command.intervention else ()
            self.device.set_up(command.phase, command.cable, command.load_torque, *change)
        self._board[Slot.SET_AT] = self._reader.index + 1
        self._cable = command.cable != "none"
        self._in_contact = self._steering.in_contact = command.phase == "contact"
        known = self.settings
        self._safety = safety_checks(
            known.limits,
            self.device.rate_hz,
            known.units,
            command,
            proves_drive=known.proves_drive,
            most=known.current_share * known.limits.current if known.current_share < 1.0 else math.inf,
        )
        self._sensors = sensors_of(command)
        return ""

    def _at_rest(self, command: AtRest) -> str:
        if self.machine.enable_allowed:
            return "The amplifier is enabled; disable it before anything is tried at the bench."
        if isinstance(command, MoveByHand):
            return move_by_hand(self.device, command)
        self._restart = True
        return try_output(self.device, command, self._board, self._wanted_at_rest)

    def _wanted_at_rest(self) -> bool:
        self._look()
        return bool(self._lost_process) or self._board[Slot.STOP_REQUESTS] != self._stops

    def _become(self, event: Event) -> None:
        self.machine = self.machine.after(event)
        self._board[Slot.MODE] = self.machine.mode
        self._board[Slot.LATCHED] = int(self.machine.latched)
        self._board[Slot.PRESSED] = int(self.machine.pressed)
        self._board[Slot.UNREADY] = int(self.machine.unready)

    def _answer(self, number: int, sentence: str) -> None:
        self._board.set_text(Text.ANSWER, sentence)
        self._board[Slot.ACK] = number


_EVENTS: dict[type, Event] = {
    Enable: Event.ENABLE,
    Disable: Event.DISABLE,
    Finish: Event.FINISH,
    Release: Event.RELEASE,
    Reset: Event.RESET,
}
