"""The simulated rig behind the device protocol: the twin's physics, raw values, enable, faults, pace."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.devices.faults import Faults, SensorFault
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost, VirtualClock, cycles_per_command
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.rig.file import default_rig, parse_rig
from fingerlab.twin.effects import parse_effects
from fingerlab.twin.protocols import RunPlan, load_preset
from fingerlab.twin.recording import simulate_session
from fingerlab.twin.session import unseal

from .loops import SINE, follow


def started(rig: SimulatedRig, enable: bool = True) -> SimulatedRig:
    rig.open()
    rig.start()
    rig.set_enable(enable)
    return rig


def test_it_is_a_device() -> None:
    rig = SimulatedRig()
    assert isinstance(rig, Device)
    assert cycles_per_command(rig) == 1


def test_its_recording_is_the_twins_within_noise() -> None:
    """Same seed, same bench: apart from the cycle that a real output needs, friction's chance and noise."""
    plan = RunPlan("on_air", "extension", SINE)
    ours = next(iter(simulate_session(load_preset(), [plan], {}, 7))).channels
    rig = started(SimulatedRig(simulation=Simulation(seed=7)))
    samples = follow(rig, ours["motor_command"])
    raw = np.array([s.raw for s in samples]).T
    daq = rig.rig.daq
    assert [s.index for s in samples] == list(range(5000))
    late = slice(1500, None)
    for row, name, channel, limit in (
        (1, "mcp_angle", daq.mcp, math.radians(0.2)),
        (2, "pip_angle", daq.pip, math.radians(0.2)),
        (3, "motor_current", daq.current_monitor, 0.05),
        (0, "endpoint_force", daq.load_cell, 0.03),
    ):
        error = channel.quantity(raw[row])[late] - ours[name][late]
        assert np.sqrt(np.mean(error**2)) < limit, name
        assert np.ptp(ours[name][late]) > 3 * limit, name  # so that the limit means something
    position = daq.encoder.quantity(raw[4])
    assert np.degrees(np.abs(position - ours["motor_position"])[late]).max() < 0.5
    assert np.degrees(np.ptp(position[late])) == pytest.approx(28.0, abs=1.5)


def test_raw_values_are_electrically_possible_and_whole_counts() -> None:
    rig = started(SimulatedRig())
    raw = np.array([rig.exchange(0.6).raw for _ in range(1500)]).T
    assert raw[0].mean() == pytest.approx(5.317 / 11.194, abs=0.01)  # thesis equation 2.1 at no load
    assert ((raw[1:3] > 0.25) & (raw[1:3] < 4.75)).all()  # KMA210: 5 to 95 % of 5 V
    assert raw[3][500:].mean() == pytest.approx(-0.48, abs=0.01)  # ADS 50/5: 0.8 V/A, inverted
    assert np.array_equal(raw[4], np.round(raw[4]))
    assert raw[4][0] == 0
    assert raw[4][-1] > 100


def test_without_enable_no_current_flows_whatever_is_commanded() -> None:
    rig = started(SimulatedRig(), enable=False)
    for _ in range(500):
        rig.exchange(5.0)
    assert rig.driven_current == 0.0
    assert rig.bench.stream.now[2] == 0.0
    assert abs(rig.bench.stream.now[0]) < 1e-6
    rig.set_enable(True)
    for _ in range(20):
        rig.exchange(0.5)
    assert rig.bench.stream.now[2] == pytest.approx(0.5, abs=1e-3)
    assert rig.make_safe()
    assert (rig.driven_current, rig.enabled) == (0.0, False)


def test_a_command_acts_from_the_next_sample_on() -> None:
    rig = started(SimulatedRig())
    rig.exchange(1.0)
    assert rig.bench.stream.now[2] == 0.0
    rig.exchange(0.0)
    assert rig.bench.stream.now[2] == pytest.approx(1 - math.exp(-1e-3 / 5e-4), abs=0.02)  # current loop


def test_the_rig_files_wiring_is_used() -> None:
    text = "[daq.encoder]\nsign = -1\ncounts_per_turn = 4000\n[daq.command]\ngain = 2\nsign = -1\n"
    rig = started(SimulatedRig(parse_rig(text + "[daq.pip]\nterminal = ''", "x")))
    sample = [rig.exchange(-0.3) for _ in range(400)][-1]
    assert rig.driven_current == pytest.approx(0.6)
    theta = rig.bench.stream.now[0]
    assert theta > 0.1
    assert sample.raw[4] == -math.floor(theta / (2 * math.pi / 4000))
    assert math.isnan(sample.raw[2])


def test_effects_and_seed_make_the_bench() -> None:
    def last(**simulation: object) -> tuple[float, ...]:
        rig = started(SimulatedRig(simulation=Simulation(**simulation)))  # type: ignore[arg-type]
        return [rig.exchange(0.5) for _ in range(300)][-1].raw

    assert last(seed=3) == last(seed=3)
    assert last(seed=3) != last(seed=4)
    stiff = last(seed=3, effects=parse_effects(["stiffness_error=0.5"]))
    assert stiff[4] < last(seed=3)[4]


def test_a_hidden_effect_is_sealed_in_what_the_session_gets() -> None:
    picked = set()
    for seed in range(12):
        rig = SimulatedRig(simulation=Simulation(seed=seed, hidden=True))
        attributes = rig.session_attributes
        assert set(attributes) == {"sealed"}
        told = unseal(attributes["sealed"], "it")
        assert told["effects"] == rig.bench.effects
        picked |= set(told["effects"])
    assert len(picked) > 5
    with pytest.raises(UserError, match="hidden effect is picked by the seed"):
        SimulatedRig(simulation=Simulation(hidden=True, effects=parse_effects(["backlash"])))


def test_the_cable_is_changed_with_the_amplifier_off() -> None:
    rig = started(SimulatedRig())
    at_rest = rig.bench.stream.now[3]
    before = [rig.exchange(0.5) for _ in range(400)][-1]
    assert rig.bench.stream.now[3] < at_rest - 0.03  # the extension cable extends
    with pytest.raises(DeviceFault, match="disable it before the cable"):
        rig.set_up("contact")
    rig.set_enable(False)
    rig.set_up("contact")
    after = rig.exchange(0.0)
    assert after.raw[4] == pytest.approx(before.raw[4], abs=1)
    assert (rig.bench.phase, rig.bench.cable) == ("contact", "flexion")
    rig.set_enable(True)
    samples = [rig.exchange(1.2) for _ in range(3000)]
    assert rig.rig.daq.load_cell.quantity(samples[-1].raw[0]) > 0.5
    rig.set_enable(False)
    rig.set_up("motor_bench", load_torque=0.02)
    assert math.isnan(rig.exchange(0.0).raw[0])
    with pytest.raises(DeviceFault, match="moves no cable"):
        rig.set_up("motor_bench", "flexion")


def test_a_known_load_rests_on_its_support_until_the_motor_lifts_it() -> None:
    """A motor without current holds no weight: it falls back, and its thread winds up either way."""
    load = 0.1
    rig = SimulatedRig(simulation=Simulation(phase="motor_bench", load_torque=load))
    rig.open()
    rig.start()
    turn = 2.0 * math.pi / rig.rig.daq.encoder.counts_per_turn
    assert all(abs(rig.exchange(0.0).raw[4]) * turn < math.radians(0.5) for _ in range(2000))
    rig.set_enable(True)
    per_amp = rig.rig.motor.torque_constant * rig.rig.motor.gear_ratio
    volts = load / per_amp / rig.rig.daq.command.gain
    # Less than the load lifts nothing, more runs off with it.
    for share, moves in ((0.3, False), (1.3, True)):
        turned = [rig.exchange(share * volts).raw[4] * turn for _ in range(400)][-1]
        assert (turned > math.radians(5.0)) is moves
    rig.set_enable(False)
    fallen = [rig.exchange(0.0).raw[4] * turn for _ in range(3000)]
    assert min(fallen) < -math.radians(10.0)  # a thread that hung loose would let it run on
    assert max(map(abs, fallen)) < 2.5 * turned


def test_a_second_start_is_refused_and_a_start_after_stop_begins_again() -> None:
    rig = SimulatedRig()
    with pytest.raises(DeviceFault, match="not open"):
        rig.start()
    started(rig)
    turned = [rig.exchange(0.5) for _ in range(300)][-1].raw[4]
    assert turned > 100
    with pytest.raises(DeviceFault, match="running already"):
        rig.start()
    rig.make_safe()
    with pytest.raises(DeviceFault, match="not running"):
        rig.exchange(0.0)
    with pytest.raises(DeviceFault, match="not running"):
        rig.set_enable(True)
    rig.start()
    first = rig.exchange(0.0)
    assert first.index == 0
    assert first.raw[4] > 0.8 * turned  # the counter has counted on
    assert rig.counted_on
    assert not rig.enabled
    rig.close()
    rig.close()


def test_a_command_that_is_no_number_is_refused() -> None:
    rig = started(SimulatedRig())
    rig.exchange(0.2)
    with pytest.raises(DeviceFault, match="nan V"):
        rig.exchange(math.nan)
    assert rig.driven_current == pytest.approx(0.2)


def test_unplugged() -> None:
    rig = started(SimulatedRig(faults=Faults(unplug_at=50)))
    seen = [rig.exchange(0.5).index for _ in range(50)]
    with pytest.raises(DeviceLost, match="no longer answers"):
        rig.exchange(0.5)
    assert seen[-1] == 49
    assert rig.driven_current == 0.0
    assert not rig.make_safe()
    with pytest.raises(DeviceLost):
        rig.set_enable(True)


def test_sensor_faults() -> None:
    faults = Faults(
        sensors=(
            SensorFault("mcp_volts", 10, 5),
            SensorFault("force_volts", 20, stuck=True),
            SensorFault("encoder_counts", 30, 3),
        ),
        encoder_jumps={40: 500.0, 45: -500.0},
    )
    rig, clean = started(SimulatedRig(faults=faults)), started(SimulatedRig())
    raw = np.array([rig.exchange(0.3).raw for _ in range(60)])
    true = np.array([clean.exchange(0.3).raw for _ in range(60)])
    assert np.flatnonzero(np.isnan(raw[:, 1])).tolist() == [10, 11, 12, 13, 14]
    assert np.flatnonzero(np.isnan(raw[:, 4])).tolist() == [30, 31, 32]
    assert (raw[20:, 0] == raw[20, 0]).all()
    assert np.ptp(raw[:20, 0]) > 0
    jump = raw[33:, 4] - true[33:, 4]
    assert jump.tolist() == [0.0] * 7 + [500.0] * 5 + [0.0] * 15
    with pytest.raises(ValueError, match="no channel 'mcp'"):
        SensorFault("mcp", 1)


def test_lost_and_late_cycles_and_clock_steps() -> None:
    clock = VirtualClock(100.0)
    faults = Faults(lost={10: 3}, late={5: 0.004}, clock_steps={20: -7.0})
    rig, whole = started(SimulatedRig(faults=faults, clock=clock)), started(SimulatedRig())
    samples = [rig.exchange(0.4) for _ in range(30)]
    assert [s.index for s in samples] == [*range(10), *range(13, 33)]
    assert [s.index for s in samples if s.lateness > 0] == [5]
    assert clock.now() == pytest.approx(100.0 + 0.033 + 0.004 - 7.0)
    for _ in range(33):
        whole.exchange(0.4)
    assert rig.bench.stream.now == whole.bench.stream.now  # the plant has lived through the lost cycles


def test_make_safe_that_fails_at_first() -> None:
    rig = started(SimulatedRig(faults=Faults(unsafe=2)))
    rig.exchange(0.5)
    assert [rig.make_safe() for _ in range(3)] == [False, False, True]
    assert rig.driven_current == 0.0


class HandClock:
    """A clock for a rig paced in real time, turned by the test; ``oversleep`` s at chosen waits."""

    def __init__(self, oversleep: dict[int, float]) -> None:
        self.time, self.waits, self.oversleep = 0.0, 0, oversleep

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds + self.oversleep.get(self.waits, 0.0)
        self.waits += 1


def test_paced_in_real_time_who_comes_late_loses_cycles() -> None:
    clock = HandClock({10: 0.0005, 20: 0.0045})
    rig = started(SimulatedRig(clock=clock))
    samples = [rig.exchange(0.1) for _ in range(40)]
    steps = np.diff([s.index for s in samples])
    assert steps.tolist() == [1] * 19 + [5] + [1] * 19
    assert samples[10].lateness == pytest.approx(0.0005)
    assert samples[20].lateness == pytest.approx(0.0045)
    assert clock.time == pytest.approx(0.044, abs=1e-3)


def test_paced_rig_survives_clock_steps_both_ways() -> None:
    clock = HandClock({})
    rig = started(SimulatedRig(faults=Faults(clock_steps={10: -3600.0, 20: 3600.0}), clock=clock))
    samples = [rig.exchange(0.1) for _ in range(40)]
    assert [s.index for s in samples] == list(range(40))
    assert clock.time < 0.1
    assert samples[21].lateness > 3500


def test_default_rig_and_the_simulated_benchs_own_constants() -> None:
    own = SimulatedRig().rig
    assert own.finger == load_preset().rig.finger
    wired = {"emergency_stop": own.daq.emergency_stop, "amplifier_ready": own.daq.amplifier_ready}
    assert own.daq == replace(default_rig().daq, **wired)  # the bench has both, for practice
    assert all(line.terminal for line in wired.values())


def test_a_bench_that_runs_away_is_a_fault() -> None:
    effects = parse_effects(["motor_viscous_friction=-50"])
    rig = started(SimulatedRig(simulation=Simulation(effects=effects)))

    def drive() -> None:
        for _ in range(20000):
            rig.exchange(0.5)

    with pytest.raises(DeviceFault, match="ran away"):
        drive()
    assert rig.make_safe()
