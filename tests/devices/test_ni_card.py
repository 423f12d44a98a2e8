"""The real nidaqmx package against a virtual PCIe-6343: the loop, the stop, and what can go wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fingerlab.acquisition.trajectories import read_trajectory
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import Device, DeviceFault, DeviceLost, Sample, cycles_per_command
from fingerlab.devices.simulated import SimulatedBench, SimulatedRig, Simulation
from fingerlab.rig import Rig
from fingerlab.rig_file import parse_rig

from .loops import SINE, follow
from .virtual_card import Card, InProcessChannel, Servicer, SimplePlant

SINGLE = '[daq]\ntiming = "single-point"\n'
BUFFERED = '[daq]\ntiming = "buffered"\n'


def rig_with(text: str = SINGLE) -> Rig:
    return parse_rig(text, "the test's rig")


def bench(text: str = SINGLE, plant: Any = None) -> tuple[Card, NiCard, InProcessChannel]:
    rig = rig_with(text)
    card = Card(plant or SimplePlant())
    channel = InProcessChannel(Servicer(card))
    return card, NiCard(rig, card.clock, channel), channel


def running(text: str = SINGLE, plant: Any = None) -> tuple[Card, NiCard, InProcessChannel]:
    card, device, channel = bench(text, plant)
    device.open()
    device.start()
    return card, device, channel


def assert_safe(card: Card) -> None:
    assert card.volts == 0.0
    assert not card.line


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


def test_where_single_points_cannot_be_had_blocks_take_over() -> None:
    rig = rig_with('[daq]\ntiming = "auto"\n')
    card = Card(SimplePlant())
    card.single_point = False
    device = NiCard(rig, card.clock, InProcessChannel(Servicer(card)))
    device._connection.remote = True  # a channel given by hand stands for the local driver
    device.open()
    assert cycles_per_command(device) == 10
    device.start()
    assert [device.exchange(0.0).index for _ in range(25)] == list(range(25))


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
    assert not card.tasks
    assert device.make_safe()
    device.close()
    device.close()
    assert_safe(card)


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


def test_lost_cycles_show_in_the_index_and_in_the_lateness() -> None:
    card, device, _ = running()
    before = [device.exchange(0.0) for _ in range(10)]
    card.pass_time(3)
    sample = device.exchange(0.0)
    assert before[-1].index == 9
    assert sample.index == 12
    assert sample.raw[0] == pytest.approx(13e-4)
    assert [device.exchange(0.0).index for _ in range(3)] == [13, 14, 15]
    late = NiCard(rig_with(BUFFERED), (slow := Card(SimplePlant())).clock, InProcessChannel(Servicer(slow)))
    late.open()
    late.start()
    for _ in range(10):
        assert late.exchange(0.0).lateness == 0.0
    slow.pass_time(35)
    lateness = [late.exchange(0.0).lateness for _ in range(60)]
    assert lateness[0] == pytest.approx(0.025, abs=1e-4)
    assert lateness[-1] == pytest.approx(0.0, abs=1e-4)


def test_a_device_that_does_not_count_single_points_is_timed_by_the_clock() -> None:
    card, device, channel = running()
    card.hooks["GetReadAttributeUInt64"] = failing(-200452)
    assert [device.exchange(0.0).index for _ in range(10)] == list(range(10))
    assert channel.servicer.calls["GetReadAttributeUInt64"] == 1  # asked once, not at every cycle
    card.pass_time(4)
    assert [device.exchange(0.0).index for _ in range(4)] == [13, 14, 15, 16]


def test_a_cycle_that_passes_between_reading_and_asking_is_not_a_lost_one() -> None:
    card, device, _ = running()
    for _ in range(5):
        device.exchange(0.0)
    card.hooks["GetReadAttributeUInt64"] = lambda: card.pass_time(1)
    asked_late = device.exchange(0.0)
    card.hooks.clear()
    assert asked_late.index == 5
    # The newest sample is the one that passed meanwhile: the next read has it, and nothing was lost.
    assert [device.exchange(0.0).index for _ in range(3)] == [6, 7, 8]
    card.pass_time(2)  # one lost for certain: the question comes at once
    assert device.exchange(0.0).index == 10


def test_arrays_are_as_the_local_driver_wants_them() -> None:
    for text in (SINGLE, BUFFERED):
        _, device, _ = running(text)
        tasks = device._tasks
        assert tasks is not None
        for array in (tasks.volts, tasks.block_volts, tasks.block_counts):
            assert array.flags["C_CONTIGUOUS"]
            assert array.dtype == np.float64


def test_partial_reads_give_what_they_surely_hold() -> None:
    for layout in ("rows", "packed"):
        card, device, _ = running(BUFFERED)
        card.layout = layout
        samples = [device.exchange(0.0) for _ in range(30)]
        card.partial = 4
        samples += [device.exchange(0.0) for _ in range(30)]
        assert [s.index for s in samples] == list(range(60))
        raw = np.array([s.raw[:4] for s in samples])
        np.testing.assert_allclose(raw, 1e-4 * np.arange(1, 61)[:, None] + np.arange(4.0), atol=1e-12)


def test_a_partial_read_that_cannot_be_told_apart_is_a_gap() -> None:
    card, device, _ = running(BUFFERED)
    card.layout = "zeros"
    for _ in range(30):
        device.exchange(0.0)
    card.partial = 4
    samples = [device.exchange(0.0) for _ in range(30)]
    assert [s.index for s in samples] == list(range(34, 64))
    assert [s.raw[0] for s in samples] == pytest.approx((1e-4 * np.arange(35, 65)).tolist())


@pytest.mark.parametrize("text", [SINGLE, BUFFERED])
def test_a_clock_that_stands_still_is_a_fault_and_not_a_wait(text: str) -> None:
    card, device, _ = running(text)
    device.set_enable(True)
    for _ in range(20):
        device.exchange(1.0)
    card.stopped_clock = True
    with pytest.raises(DeviceFault, match=r"as if the sample clock stood still.*-200284"):
        device.exchange(1.0)
    assert device.make_safe()
    assert_safe(card)


def test_overwritten_samples() -> None:
    card, device, _ = running(BUFFERED)
    device.exchange(0.0)
    card.pass_time(5000)
    for _ in range(9):  # what is left of the block comes first
        device.exchange(0.0)
    with pytest.raises(DeviceFault, match=r"overwritten samples.*-200279"):
        device.exchange(0.0)
    assert device.make_safe()
    assert_safe(card)


SENSORLESS = SINGLE + '[daq.pip]\nterminal = ""\n'


def test_an_odd_number_of_inputs_is_refused_in_words() -> None:
    _, device, _ = bench(SENSORLESS)
    with pytest.raises(DeviceFault, match=r"even number of analog inputs.*-200820"):
        device.open()


def test_a_bench_without_a_sensor_reads_nan_there() -> None:
    two = SINGLE + '[daq.pip]\nterminal = ""\n[daq.load_cell]\nterminal = ""\n'
    _, device, _ = running(two)
    raw = device.exchange(0.0).raw
    assert [math.isnan(v) for v in raw] == [True, False, True, False, False]
    assert raw[1] == pytest.approx(1.0001)


def test_a_command_that_is_no_number_or_too_large() -> None:
    card, device, _ = running()
    device.exchange(0.5)
    device.exchange(0.5)
    with pytest.raises(DeviceFault, match="nan V"):
        device.exchange(math.nan)
    assert card.volts == 0.5
    device.exchange(99.0)
    device.exchange(0.0)
    assert card.history[-1][0] == 10.0


def failing(code: int) -> Callable[[], None]:
    from .virtual_card import DaqFailure

    def fail() -> None:
        raise DaqFailure(code)

    return fail


@pytest.mark.parametrize("code", [-200279, -200010, -200361, -209829, -200714, -209800, -209802, -209803])
def test_every_code_of_reading_has_a_sentence_and_leaves_a_stop_that_works(code: int) -> None:
    card, device, _ = running()
    device.set_enable(True)
    for _ in range(5):
        device.exchange(1.0)
    card.hooks["ReadAnalogF64"] = failing(code)
    with pytest.raises(DeviceFault) as fault:
        device.exchange(1.0)
    sentence = str(fault.value)
    assert f"(NI-DAQmx {code})" in sentence
    assert "virtual card" not in sentence  # our own words, not the driver's
    card.hooks.clear()
    assert device.make_safe()
    assert_safe(card)


def test_every_code_has_a_sentence_of_its_own() -> None:
    from fingerlab.devices.ni.errors import FAULTS

    listed = (
        -200279,
        -200284,
        -200010,
        -200361,
        -209829,
        -200714,
        -209800,
        -209801,
        -209802,
        -209803,
        -200820,
    )
    sentences = [FAULTS[code] for code in listed]
    assert len(set(sentences)) == len(listed)
    assert all(s[0].isupper() and s.endswith(".") and len(s) > 60 for s in sentences)


def test_a_late_write_is_a_fault() -> None:
    card, device, _ = running()
    device.exchange(0.0)
    card.hooks["WriteAnalogScalarF64"] = failing(-209801)
    with pytest.raises(DeviceFault, match=r"wrote the motor's command only after.*-209801"):
        device.exchange(0.0)


@pytest.mark.parametrize("code", [-200220, -201003, -200324, -50405, -88709, -88710, -200088])
def test_a_card_that_is_gone_is_lost(code: int) -> None:
    card, device, _ = running()
    device.exchange(0.0)
    card.hooks["ReadAnalogF64"] = failing(code)
    with pytest.raises(DeviceLost, match=f"NI-DAQmx {code}"):
        device.exchange(0.0)


def test_an_unknown_code_is_told_in_the_drivers_words() -> None:
    card, device, _ = running()
    card.hooks["ReadAnalogF64"] = failing(-200001)
    with pytest.raises(
        DeviceFault, match="Dev1: NI-DAQmx reports error -200001: Error -200001 of the virtual"
    ):
        device.exchange(0.0)


def test_a_stop_that_is_refused_says_so_and_resets_the_card_as_a_last_resort() -> None:
    card, device, _ = running()
    device.set_enable(True)
    for _ in range(5):
        device.exchange(1.0)
    card.hooks["WriteAnalogScalarF64"] = failing(-200714)
    assert not device.make_safe()
    assert_safe(card)  # the reset has done it; it is only not confirmed
    assert card.resets == 1
    card.hooks.clear()
    assert device.make_safe()


def test_wrong_names_in_the_rig_file() -> None:
    _, device, _ = bench('[daq]\ndevice = "Dev3"\n')
    with pytest.raises(DeviceLost, match=r"knows no card of that name \(it knows Dev1\)"):
        device.open()
    assert not device.make_safe()
    card, device, _ = bench(SINGLE + '[daq.mcp]\nterminal = "ai99"\n')
    with pytest.raises(DeviceFault, match="no such terminal"):
        device.open()
    assert not card.tasks
    _, device, _ = bench(SINGLE + '[daq.command]\nterminal = "ao9"\n')
    with pytest.raises(DeviceFault, match="no such terminal"):
        device.open()
