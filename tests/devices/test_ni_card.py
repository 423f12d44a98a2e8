"""The real nidaqmx package against a virtual PCIe-6343: the loop, enable and stop, who may have the card."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.acquisition.control.machine import Enable, Mode, Release, Reset
from fingerlab.acquisition.control.trajectories import read_trajectory
from fingerlab.acquisition.status import Slot
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import Device, DeviceFault, Sample, cycles_per_command
from fingerlab.devices.simulated import SimulatedBench, SimulatedRig, Simulation
from tests.acquisition.driving import Driven

from .card_bench import BUFFERED, SINGLE, assert_safe, bench, failing, rig_with, running
from .loops import SINE, follow
from .virtual_card import Card, InProcessChannel, Servicer, SimplePlant


def test_it_is_a_device_and_tells_its_mode() -> None:
    _, device, _ = bench()
    assert isinstance(device, Device)
    assert (device.name, device.rate_hz, cycles_per_command(device)) == ("Dev1", 1000.0, 1)
    assert cycles_per_command(bench(BUFFERED)[1]) == 10


def test_thousands_of_cycles_are_whole_and_in_order() -> None:
    """Every voltage and count belongs to the one cycle that the index names."""
    _, device, _ = running()
    device.set_enable(True)
    samples = [device.exchange(0.5 * math.cos(0.01 * k)) for k in range(5000)]
    assert [s.index for s in samples] == list(range(5000))
    raw = np.array([s.raw for s in samples])
    cycles = 1e-4 * np.arange(1, 5001)
    np.testing.assert_allclose(raw[:, :4], cycles[:, None] + np.arange(4.0), atol=1e-12)
    assert max(s.lateness for s in samples) < 1e-6
    # A command acts from the edge of its sample on: the wheel of cycle k has felt commands up to k - 2.
    commands = 100.0 * 0.5 * np.cos(0.01 * np.arange(5000))
    wheel = np.concatenate([[0.0], np.cumsum(commands)[:-1]])
    np.testing.assert_allclose(raw[:, 4], np.floor(wheel + 1e-9), atol=1)
    assert raw[:, 4].min() < -1000  # also below the point where it was armed


def test_a_cycle_costs_four_calls() -> None:
    _, device, channel = running()
    device.exchange(0.0)
    before = dict(channel.servicer.calls)
    for _ in range(100):
        device.exchange(0.0)
    made = {k: v - before.get(k, 0) for k, v in channel.servicer.calls.items() if v != before.get(k, 0)}
    assert made == {
        "WriteAnalogScalarF64": 100,
        "ReadAnalogF64": 100,
        "ReadCounterScalarF64": 100,
        "GetReadAttributeUInt64": 100,
    }


@pytest.mark.parametrize("text", [SINGLE, BUFFERED])
def test_two_recordings_are_the_same_to_the_last_bit(text: str) -> None:
    def record() -> list[Sample]:
        rig = rig_with(text)
        plant = SimulatedBench(Simulation(seed=5), rig.daq)
        card = Card(plant)
        device = NiCard(rig, card.clock, InProcessChannel(Servicer(card)))
        device.open()
        device.start()
        device.set_enable(True)
        return [device.exchange(0.4 + 0.3 * math.sin(0.006 * k)) for k in range(2000)]

    first, second = record(), record()
    assert [s.raw for s in first] == [s.raw for s in second]
    assert [s.index for s in first] == [s.index for s in second] == list(range(2000))
    counts = [s.raw[4] for s in first]
    assert max(counts) > 100  # the simulated motor has turned


def test_the_loop_cannot_tell_the_card_from_the_simulated_rig() -> None:
    """The same bench behind the real nidaqmx package and behind the simulated rig: the same samples."""
    rig = rig_with()
    card = Card(SimulatedBench(Simulation(seed=9), rig.daq))
    records = []
    for device in (
        NiCard(rig, card.clock, InProcessChannel(Servicer(card))),
        SimulatedRig(rig, Simulation(seed=9)),
    ):
        device.open()
        device.start()
        device.set_enable(True)
        records.append(follow(device, read_trajectory(SINE).command(np.arange(2500) / 1000)))
    assert [s.raw for s in records[0]] == [s.raw for s in records[1]]
    assert [s.index for s in records[0]] == [s.index for s in records[1]]
    position = np.degrees(rig.daq.encoder.quantity(np.array([s.raw[4] for s in records[0]])))
    assert np.ptp(position[1500:]) == pytest.approx(28.0, abs=1.5)


def test_buffered_blocks_are_whole_and_the_counter_is_in_step() -> None:
    _, device, _ = running(BUFFERED)
    device.set_enable(True)
    samples = [device.exchange(0.25) for _ in range(1000)]
    assert [s.index for s in samples] == list(range(1000))
    raw = np.array([s.raw for s in samples])
    np.testing.assert_allclose(raw[:, 0], 1e-4 * np.arange(1, 1001), atol=1e-12)
    # The wheel turns 25 counts a cycle from the first cycle on: analog and counter begin on one edge.
    assert raw[:, 4].tolist() == (25.0 * np.arange(1, 1001)).tolist()


@pytest.mark.parametrize("refusal", [-209857, -201116, -200821, -200998, -200077])
def test_where_single_points_cannot_be_had_blocks_take_over(refusal: int) -> None:
    rig = rig_with('[daq]\ntiming = "auto"\n')
    card = Card(SimplePlant())
    card.single_point, card.refusal = False, refusal
    device = NiCard(rig, card.clock, InProcessChannel(Servicer(card)))
    device._connection.remote = True  # a channel given by hand stands for the local driver
    device.open()
    assert cycles_per_command(device) == 10
    device.start()
    assert [device.exchange(0.0).index for _ in range(25)] == list(range(25))


def test_a_single_point_output_takes_no_value_before_it_is_started() -> None:
    """As NI-DAQmx refuses it (-200803): the order of starting has to be that of the driver."""
    _, device, _ = bench()
    device.open()
    assert device._tasks is not None
    import nidaqmx

    with pytest.raises(nidaqmx.errors.DaqError) as refused:
        device._tasks.write_volts(0.0)
    assert refused.value.error_code == -200803
    device.start()
    assert device.exchange(0.0).index == 0


def test_codes_are_what_the_package_calls_them() -> None:
    from nidaqmx.error_codes import DAQmxErrors

    from fingerlab.devices.ni.connection import FAULTS, LOSSES, UNSUPPORTED

    for code in (*FAULTS, *LOSSES, *UNSUPPORTED):
        assert DAQmxErrors(code), code
    assert DAQmxErrors(-209857).name == "DEVICE_DOES_NOT_SUPPORT_HWTSP"
    assert DAQmxErrors(-209802).name.endswith("DETECTED_MISSED_SAMP_CLK")
    assert DAQmxErrors(-200279).name == "SAMPLES_NO_LONGER_AVAILABLE"


def test_opening_and_starting_leave_the_output_at_zero_and_the_line_low() -> None:
    card, device, _ = bench()
    card.volts, card.line = 3.0, True  # left by whoever was here before
    device.open()
    assert_safe(card)
    device.start()
    device.exchange(0.0)
    assert_safe(card)


@pytest.mark.parametrize("text", [SINGLE, BUFFERED])
def test_enable_and_stop(text: str) -> None:
    card, device, _ = running(text)
    with_enable = []
    for on in (False, True, False):
        device.set_enable(on)
        with_enable.append(card.line)
    assert with_enable == [False, True, False]
    device.set_enable(True)
    for _ in range(50):
        device.exchange(2.0)
    assert (card.volts, card.line) == (2.0, True)
    assert device.make_safe()
    assert_safe(card)
    assert [task.kind for task in card.tasks.values()] == ["ci"]  # the encoder counts on
    assert device.make_safe()
    device.close()
    device.close()
    assert not card.tasks
    assert_safe(card)


@pytest.mark.parametrize("text", [SINGLE, BUFFERED])
def test_the_encoder_counts_on_over_a_stop_and_what_was_not_read_is_not_taken_for_new(text: str) -> None:
    """25 counts a cycle under 0.25 V; then somebody turns the wheel by 700 while the clock stands."""
    card, device, _ = running(text)
    device.set_enable(True)
    for _ in range(95):
        last = device.exchange(0.25)
    card.pass_time(3)  # edges that nobody has read
    turned = card.plant.wheel
    assert device.make_safe()
    assert not device.counted_on
    card.plant.wheel += 700.0
    device.start()
    assert device.counted_on
    assert device.exchange(0.0).raw[4] == turned + 700.0
    assert turned >= last.raw[4]
    card.hooks["ReadAnalogF64"] = failing(-200279)
    with pytest.raises(DeviceFault):
        [device.exchange(0.0) for _ in range(11)]
    card.hooks.clear()
    device.make_safe()
    device.start()
    assert not device.counted_on  # nobody knows what the driver's error did to the counter


@pytest.mark.parametrize("how", ["stop", "fault"])
def test_the_reference_is_kept_over_a_stop_and_a_fault(how: str) -> None:
    card, device, _ = bench(plant=SimulatedBench(Simulation(seed=2), rig_with().daq))
    driven = Driven(device)
    driven.run(endless=True)
    driven.cycles(2400)
    before = driven.column("motor_position")[-1]
    if how == "stop":
        driven.board[Slot.STOP_REQUESTS] += 1
    else:
        driven.loop.lose("The recorder has ended.", farewell=False)
    driven.cycles(800)
    assert driven.ask(Release() if how == "stop" else Reset()) == ""
    assert driven.loop.machine.mode is Mode.INITIALISED
    truth = card.plant.stream.now[0]
    assert driven.column("motor_position")[-1] == pytest.approx(truth, abs=1.5e-3)  # two counts
    assert abs(truth - before) > math.radians(1.0)  # it has run on to where the springs hold it
    assert driven.ask(Enable()) == ""


def test_stopping_alone_would_not_have_been_enough() -> None:
    """The card holds its last value, and a late write to the timed task is lost: the fresh task does it."""
    card, device, _ = running()
    for _ in range(5):
        device.exchange(1.5)
    device.abandon(late_write=0.0)
    assert card.volts == 1.5
    assert device.read_back_output() == pytest.approx(1.5, abs=1e-3)
    assert device.make_safe()
    assert device.read_back_output() == pytest.approx(0.0, abs=1e-3)


def test_active_low_enable() -> None:
    card, device, _ = running(SINGLE + "[daq.enable]\nactive_high = false\n")
    assert card.line
    device.set_enable(True)
    assert not card.line
    assert device.make_safe()
    assert card.line


def test_a_second_start_and_a_start_after_a_stop() -> None:
    card, device, _ = running()
    with pytest.raises(DeviceFault, match="running already"):
        device.start()
    with pytest.raises(DeviceFault, match="open already"):
        device.open()
    for _ in range(20):
        device.exchange(0.5)
    device.make_safe()
    with pytest.raises(DeviceFault, match="not running"):
        device.exchange(0.0)
    with pytest.raises(DeviceFault, match="not running"):
        device.set_enable(True)
    device.start()
    sample = device.exchange(0.0)
    assert (sample.index, sample.raw[4]) == (0, 0.0)
    assert_safe(card)


def test_a_second_program_is_refused_and_does_no_harm() -> None:
    card, device, channel = running()
    device.set_enable(True)
    device.exchange(1.0)
    device.exchange(1.0)
    other = NiCard(rig_with(), card.clock, channel)
    with pytest.raises(DeviceFault, match=r"in use by another program.*\(NI-DAQmx -\d+\)"):
        other.open()
    other.close()  # as any program does in its "finally"
    assert (card.resets, card.volts, card.line) == (0, 1.0, True)
    assert device.exchange(1.0).index == 2


def test_a_second_analog_task_is_refused_by_the_driver() -> None:
    _, device, _ = running()
    task = device._connection.task("intruder")
    task.ai_channels.add_ai_voltage_chan("Dev1/ai5")
    import nidaqmx

    with pytest.raises(nidaqmx.errors.DaqError) as refused:
        task.start()
    assert refused.value.error_code == -50103
    with pytest.raises(DeviceFault, match="in use by its own tasks"):
        device.read_back_output()


def test_a_guardian_stops_what_a_lost_process_left() -> None:
    card, device, channel = running()
    device.set_enable(True)
    for _ in range(5):
        device.exchange(2.0)
    del device  # killed: nobody gives its tasks back, and the server keeps them
    guardian = NiCard(rig_with(), card.clock, channel)
    assert guardian.make_safe()
    assert_safe(card)
    assert card.resets == 1


def test_the_encoder_s_wires_and_filter_reach_the_card_and_none_is_told_unasked() -> None:
    """By the attributes' numbers in NI's NIDAQmx.h: terminal, filter and its pulse width of A, B and Z."""
    a, b, z = 0x219D, 0x219E, 0x219F
    card, device, _ = running(SINGLE)
    (encoder,) = [task for task in card.tasks.values() if task.kind == "ci"]
    assert encoder.attributes == {}
    device.close()
    wires = '[daq.encoder]\na = "PFI1"\nb = "PFI3"\nfilter_time = { value = 5.12, unit = "us" }\n'
    card, device, _ = running(SINGLE + wires)
    (encoder,) = [task for task in card.tasks.values() if task.kind == "ci"]
    told = encoder.attributes
    assert (told[a], told[b], z in told) == ("/Dev1/PFI1", "/Dev1/PFI3", False)
    assert told[0x21FB] is told[0x2200] is True  # filters of A and B; Z is not used
    assert told[0x21FC] == told[0x2201] == pytest.approx(5.12e-6)
    assert len(told) == 6
    device.close()
