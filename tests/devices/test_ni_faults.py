"""The real nidaqmx package against a virtual PCIe-6343: lost cycles, partial reads, and every error code."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import DeviceFault, DeviceLost

from .card_bench import BUFFERED, SINGLE, assert_safe, bench, failing, rig_with, running
from .virtual_card import Card, InProcessChannel, Servicer, SimplePlant


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
    from fingerlab.devices.ni.connection import FAULTS

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
