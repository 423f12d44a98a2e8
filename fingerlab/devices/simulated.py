"""The simulated rig as a device: the twin behind raw volts and counts, one cycle at a time.

Like the card, it updates its output at the edge of the sample clock, so that a command computed from
one sample acts from the next one on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fingerlab.core.errors import UserError
from fingerlab.devices.faults import ChargePump, Faults, FaultySensors, LineFault
from fingerlab.devices.protocol import (
    LINES,
    NO_LINES,
    STEP,
    Clock,
    DeviceFault,
    DeviceLost,
    Sample,
    VirtualClock,
)
from fingerlab.rig.daq import AnalogInput, Daq, SafetyLines
from fingerlab.rig.file import INTERVENTION, Rig, default_rig, intervention_of
from fingerlab.twin.bench import preset_of
from fingerlab.twin.effects import check_effects
from fingerlab.twin.plant import CONTACT, ON_AIR, OUTPUTS
from fingerlab.twin.protocols import PRACTICE, RATE_HZ, Preset, RunPlan, setup_of
from fingerlab.twin.recording import BenchStream, seeded_truth
from fingerlab.twin.session import SEALED, SIMULATION, pick_hidden, seal

NAME = "simulated rig"

SLACK = math.radians(1.5)
GIVE = math.radians(0.5)
"""How far the pulley turns until the thread of a known load is taut, and from there until the load is off its
support, for a thread gives a little (assumed)."""

_THETA = OUTPUTS.index("theta")


@dataclass(frozen=True)
class Simulation:
    """Which bench is simulated; plain values, so that another process can build the same one.

    Attributes:
        preset: name or TOML file of the twin, or a saved model's file, whose bench it is then.
        seed: same seed, same bench, same noise.
        effects: id -> parameter -> value, SI, as ``twin.effects.parse_effects`` gives them.
        hidden: one effect (or none) picked by the seed, kept secret in the session.
        phase, cable: the first set-up; the cable of the phase where it is None.
        load_torque: N m, known load of a motor bench.
    """

    preset: str = PRACTICE
    seed: int = 0
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    hidden: bool = False
    phase: str = ON_AIR
    cable: str | None = None
    load_torque: float = 0.0


RUN_OUT = 5e-3
"""N m s/rad at the output, without current: at 200 degrees a second what an RE40 with a gear of 4.3 needs to
run idle (no-load current 137 mA, 30.2 mN m/A: maxon catalogue). A driven motor has what effects give it."""


def simulated_rig_file(preset: Preset) -> Rig:
    """The rig that the simulated bench says of itself: its own constants, wired like the default rig.

    It also has an emergency stop and an amplifier that tells whether it is ready, for practice.
    """
    wiring = {key: default_rig().extra[key] for key in ("daq", "limits")}
    lines = {"emergency_stop": "port0/line2", "amplifier_ready": "port0/line3"}
    wiring["daq"] = wiring["daq"] | {name: {"terminal": terminal} for name, terminal in lines.items()}
    return replace(preset.rig, extra={**preset.rig.extra, **wiring})


class SimulatedBench:
    """Amplifier, plant and sensors: set value (V) and enable in, raw volts and counts out.

    Attributes:
        stream: the plant of the present set-up; ``stream.now`` is what really is.
    """

    def __init__(self, simulation: Simulation, daq: Daq) -> None:
        self.preset = preset_of(simulation.preset, simulation.seed)
        self.simulation = simulation
        self._daq = daq
        self._truth, self._seeds = seeded_truth(self.preset, simulation.seed)
        self.effects = self._effects(simulation)
        self._counts_before = 0.0
        self._by_hand = dict.fromkeys(("load_cell", "mcp", "pip", "encoder"), 0.0)
        self._touched = self._enabled = False
        self._lines = [_line(channel) for channel in daq.inputs]
        self._amps = daq.command.sign * daq.command.gain
        self._turn = daq.encoder.sign
        self.stream: BenchStream
        self.set_up(simulation.phase, simulation.cable, simulation.load_torque)

    def set_up(
        self, phase: str, cable: str | None = None, load_torque: float = 0.0, intervention: str = ""
    ) -> None:
        """Change the cable and the load cell's place, as an operator does between runs.

        The finger hangs at rest afterwards; the encoder goes on counting from where it was. A known load
        rests on its support with its thread a little slack, and hangs on the motor once it is lifted from
        there: a motor without current could not hold it.

        Raises:
            UserError: phase and cable do not go together.
        """
        attributes = {INTERVENTION: intervention} if intervention else {}
        plan = RunPlan(*setup_of(phase, cable), {}, load_torque, attributes)
        change = intervention_of(attributes, "of the set-up")
        if hasattr(self, "stream"):
            self._counts_before += self.stream.seen()[4]
        rng = np.random.default_rng(self._seeds.spawn(1)[0])
        turn = self._daq.encoder.counts_per_turn
        self.stream = BenchStream(self.preset, self._truth, plan, self.effects, rng, counts_per_turn=turn)
        self.stream.brake(0.0 if self._enabled else RUN_OUT)
        self.phase, self.cable = plan.phase, plan.cable
        self._load = plan.load_torque + (0.0 if change is None else change.load_torque)

    def advance(self, volts: float, enabled: bool) -> None:
        """One cycle with the amplifier's set value held; without enable there is no current."""
        if self._load:
            turned = self.stream.now[_THETA]
            share = min(max((abs(turned) - SLACK) / GIVE, 0.0), 1.0)
            self.stream.hang(math.copysign(self._load * share, turned))  # a thread winds up either way
        if enabled != self._enabled:
            self._enabled = enabled
            self.stream.brake(0.0 if enabled else RUN_OUT)
        self.stream.advance(self._amps * volts if enabled else 0.0)

    def raw(self) -> tuple[float, ...]:
        """Raw values in the order of ``RAW_CHANNELS``; each call has noise of its own."""
        force, mcp, pip, current, counts = self.stream.seen()
        if self._touched:
            hand = self._by_hand
            counts += round(hand["encoder"] * self._daq.encoder.counts_per_turn / (2.0 * math.pi))
            force, mcp, pip = force + hand["load_cell"], mcp + hand["mcp"], pip + hand["pip"]
        lines = self._lines
        return (
            _volts(force, *lines[0]),
            _volts(mcp, *lines[1]),
            _volts(pip, *lines[2]),
            _volts(current, *lines[3]),
            self._turn * (self._counts_before + counts),
        )

    def move_by_hand(self, channel: str, amount: float) -> None:
        """What a hand adds to a sensor: ``load_cell`` (N), ``mcp``, ``pip``, ``encoder`` (rad)."""
        self._by_hand[channel] = amount
        self._touched = any(self._by_hand.values())

    def session_attributes(self) -> dict[str, str]:
        """Attributes by which ``reveal`` later tells what this bench had; sealed where it was hidden."""
        facts = {
            "protocol": "recorded",
            "preset": self.preset.name,
            "effects": {name: dict(values) for name, values in self.effects.items()},
            "seed": self.simulation.seed,
        }
        return {SEALED: seal(facts)} if self.simulation.hidden else {SIMULATION: json.dumps(facts)}

    def _effects(self, simulation: Simulation) -> dict[str, dict[str, float]]:
        if not simulation.hidden:
            return check_effects(simulation.effects, "The simulated rig")
        if simulation.effects:
            raise UserError("A hidden effect is picked by the seed; leave out the effects, or do not hide.")
        rng = np.random.default_rng(np.random.SeedSequence(simulation.seed, spawn_key=(2**31,)))
        return pick_hidden((ON_AIR, CONTACT), rng)


class SimulatedRig:
    """The simulated bench behind the device protocol.

    Args:
        rig: whose wiring and scaling is used; the simulated bench's own where it is None.
        clock: paced in real time by this clock; as fast as possible on a virtual one, or where it is None.
        wired: how the bench is really wired, where that differs from what the rig says (for practice).
    """

    name = NAME
    rate_hz = RATE_HZ

    def __init__(
        self,
        rig: Rig | None = None,
        simulation: Simulation | None = None,
        faults: Faults | None = None,
        clock: Clock | None = None,
        wired: Daq | None = None,
    ) -> None:
        simulation, faults = simulation or Simulation(), faults or Faults()
        self.rig = rig or simulated_rig_file(preset_of(simulation.preset, simulation.seed))
        self._daq = wired or self.rig.daq
        self.bench = SimulatedBench(simulation, self._daq)
        self._faults = faults
        self._clock: Clock = clock or VirtualClock()
        self._paced = not isinstance(self._clock, VirtualClock)
        self._unsafe = faults.unsafe
        self._running = self._open = self._enabled = False
        self._output = 0.0
        self._index = -1
        self._origin = self._skew = 0.0
        self._zero = 0.0
        self._counting = self.counted_on = False
        self._sensors = FaultySensors(faults)
        self._unplug_at = math.inf if faults.unplug_at is None else faults.unplug_at
        self._steps_clock, self._spoils = (
            bool(faults.clock_steps),
            bool(faults.sensors or faults.encoder_jumps or faults.swapped),
        )
        self._jumps = bool(faults.lost or faults.late)
        self._low, self._high = self._daq.command.low, self._daq.command.high
        lines = self.safety_lines
        self._pump = ChargePump(lines.dead_man.hold_time) if lines.dead_man.terminal else None
        self._wired = tuple(bool(getattr(lines, name).terminal) for name in LINES)
        self._by_hand = [False, True]  # emergency stop pressed, amplifier ready
        self._lines = NO_LINES
        self._cycles = 0  # of the bench, whatever was started anew
        self._fault_until: dict[LineFault, float] = {}
        self._see_lines(-1)

    @property
    def safety_lines(self) -> SafetyLines:
        """The digital lines of the rig beside enable."""
        return self._daq.safety_lines

    @property
    def powered(self) -> bool:
        """Whether the amplifier may drive: enable line up, dead-man alive, emergency stop not pressed."""
        pump = self._pump is None or self._pump.on or self._faults.pump_sticks
        return self._enabled and pump and self._lines[0] != 1.0 and self._lines[1] != 0.0

    @property
    def driven_current(self) -> float:
        """Current (A) that the amplifier is told to make now; zero where it may not drive."""
        return float(self._daq.command.current(self._output)) if self.powered else 0.0

    @property
    def enabled(self) -> bool:
        """Whether the enable line is up."""
        return self._enabled

    @property
    def session_attributes(self) -> dict[str, str]:
        """What a session recorded from this device should carry so that ``reveal`` can tell."""
        return self.bench.session_attributes()

    def set_up(
        self, phase: str, cable: str | None = None, load_torque: float = 0.0, intervention: str = ""
    ) -> None:
        """Change cable and load cell, as an operator does between runs; only with the amplifier off.

        Raises:
            DeviceFault: the amplifier is enabled, or phase and cable do not go together.
        """
        if self._enabled:
            raise DeviceFault("The amplifier is enabled; disable it before the cable is changed.")
        try:
            self.bench.set_up(phase, cable, load_torque, intervention)
        except UserError as error:
            raise DeviceFault(str(error)) from error

    def move_by_hand(self, channel: str, amount: float) -> None:
        """Press the load cell (N), bend a joint or turn the pulley (rad), set a line, as an operator does."""
        if channel in LINES:
            self.set_line(channel, bool(amount))
            return
        self.bench.move_by_hand(channel, amount)

    def set_line(self, line: str, on: bool) -> None:
        """Press or release the emergency stop, or make the amplifier (not) ready, as one of ``LINES``.

        Raises:
            DeviceFault: the rig has no such line.
        """
        if not self._wired[LINES.index(line)]:
            raise DeviceFault(f"The rig file names no line {line}; give its terminal in the section [daq].")
        self._by_hand[LINES.index(line)] = on

    def beat(self) -> None:
        """Invert the dead-man's line."""
        self._answer()
        if self._pump is not None:
            self._pump.invert()

    def freeze(self, cycles: int) -> None:
        """The bench goes on for so many cycles while the program stands still, as where a computer hangs."""
        for _ in range(cycles):
            self._move()
        self._index += cycles

    def open(self) -> None:
        self._answer()
        self._open, self._counting = True, False
        self._output, self._enabled = 0.0, False

    def start(self) -> None:
        self._answer()
        if not self._open:
            raise DeviceFault("The simulated rig is not open; open it before it is started.")
        if self._running:
            raise DeviceFault("The simulated rig is running already; stop it before it is started again.")
        if not math.isfinite(self.bench.stream.now[0]):
            raise DeviceFault("The simulated bench ran away; open it again.")
        self._output, self._enabled, self._running = 0.0, False, True
        self._index = -1
        self.counted_on = self._counting
        if not self._counting:
            self._counting = True
            self._zero = self.bench.raw()[4]  # counts are cumulative from arming
        self._sensors = FaultySensors(self._faults)
        self._origin = self._now() + 1.0 / self.rate_hz

    def set_enable(self, on: bool) -> None:
        self._answer()
        if on and not self._running:
            raise DeviceFault("The simulated rig is not running; start it before the amplifier is enabled.")
        self._enabled = on

    def exchange(self, command_volts: float) -> Sample:
        if self._index >= self._unplug_at:
            self._answer()
        if not self._running:
            raise DeviceFault("The simulated rig is not running; start it first.")
        if not math.isfinite(command_volts):
            raise DeviceFault(f"The command is {command_volts} V; the output keeps its last value.")
        cycles, lateness = self._pace() if self._paced else self._jump()
        try:
            for _ in range(cycles):
                self._move()
        except UserError as error:  # it ran away
            raise DeviceFault(str(error)) from error
        low, high = self._low, self._high
        self._output = low if command_volts < low else high if command_volts > high else command_volts
        self._index += cycles
        if self._steps_clock and self._index in self._faults.clock_steps:
            seconds = self._faults.clock_steps[self._index]
            if isinstance(self._clock, VirtualClock):
                self._clock.step(seconds)
            else:
                self._skew += seconds
        force, mcp, pip, current, counts = self.bench.raw()
        raw: tuple[float, ...] = (force, mcp, pip, current, counts - self._zero)
        if self._spoils:
            raw = self._sensors.spoil(self._index, raw)
        if self._index >= self._unplug_at:
            self._answer()
        self._see_lines(self._index)
        return Sample(self._index, raw, lateness, self._lines)

    def make_safe(self) -> bool:
        self._running = False
        if self._unsafe > 0:
            self._unsafe -= 1
            return False
        self._output, self._enabled = 0.0, False
        return not self._unplugged()

    def close(self) -> None:
        self.make_safe()
        self._open = False

    def _move(self) -> None:
        """One cycle of the bench with its output as it is."""
        self._cycles += 1
        if self._pump is not None:
            self._pump.wait(1.0 / self.rate_hz)
        self.bench.advance(self._output, self.powered)

    def _see_lines(self, index: int) -> None:
        if not any(self._wired):
            return
        states = list(self._by_hand)
        for fault in self._faults.lines:
            if index >= fault.start or fault in self._fault_until:
                until = self._fault_until.setdefault(fault, self._cycles + fault.cycles)
                if self._cycles < until:
                    states[LINES.index(fault.line)] = fault.on
        stop, ready = (
            float(on) if wired else math.nan for on, wired in zip(states, self._wired, strict=True)
        )
        self._lines = stop, ready

    def _unplugged(self) -> bool:
        return self._index >= self._unplug_at

    def _answer(self) -> None:
        if self._unplugged():
            self._running = False
            self._output, self._enabled = 0.0, False  # nothing feeds the amplifier any more
            raise DeviceLost(
                "The simulated rig no longer answers, as if its cable had been pulled; connect it and open "
                "it again."
            )

    def _jump(self) -> tuple[int, float]:
        """Cycles until the next one that is seen, and its lateness, on a clock that the rig turns itself."""
        if not self._jumps:
            self._clock.sleep(1.0 / self.rate_hz)
            return 1, 0.0
        cycles = 1 + self._faults.lost.get(self._index + 1, 0)
        late = self._faults.late.get(self._index + cycles, 0.0)
        self._clock.sleep(cycles / self.rate_hz + late)
        return cycles, late

    def _pace(self) -> tuple[int, float]:
        """Wait for the next cycle in real time; who comes late has lost the cycles in between."""
        due = self._origin + (self._index + 1) / self.rate_hz
        early = due - self._now()
        if early > STEP:  # the clock was set back
            self._origin -= early - 1.0 / self.rate_hz
            due, early = self._now() + 1.0 / self.rate_hz, 1.0 / self.rate_hz
        if early > 0.0:
            self._clock.sleep(early)
        planned = self._faults.late.get(self._index + 1, 0.0)
        if planned:
            self._clock.sleep(planned)
        late = max(self._now() - due, 0.0)
        if late > STEP:  # the clock was set forward, or the machine has slept
            self._origin += late
            if self._pump is not None:
                self._pump.wait(late)
            return 1, late
        return 1 + int(late * self.rate_hz) + self._faults.lost.get(self._index + 1, 0), late

    def _now(self) -> float:
        return self._clock.now() + self._skew


def _volts(quantity: float, sign: float, gain: float, offset: float, low: float, high: float) -> float:
    """What a channel makes of a quantity; NaN stays NaN."""
    volts = (sign * quantity - offset) / gain
    return low if volts < low else high if volts > high else volts


def _line(channel: AnalogInput) -> tuple[float, float, float, float, float]:
    """Scaling and range of a channel as plain numbers; NaN throughout where nothing is connected."""
    sign = float(channel.sign) if channel.terminal else math.nan
    return sign, channel.gain, channel.offset, channel.low, channel.high
