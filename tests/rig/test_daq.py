"""Wiring and limits in the rig file: defaults, scaling against data sheets, one sentence for a mistake."""

from __future__ import annotations

import math

import pytest

from fingerlab.core.errors import UserError
from fingerlab.rig.daq import AnalogInput, Daq, Encoder, encoder_wires, plain_section, second_terminal
from fingerlab.rig.file import Motor, Rig, default_rig, parse_rig
from fingerlab.rig.limits import BENCH_LIMITS, Limits


def test_the_default_rig_file_states_every_default_and_where_it_comes_from():
    rig = default_rig()
    stated, default = plain_section(rig.daq), plain_section(Daq())
    sources = stated.pop("sources")
    for channel in ("load_cell", "mcp", "pip"):  # the file asks for a narrower range than the dataclass
        for end in ("low", "high"):
            assert abs(stated[channel].pop(end)) == 5.0
            default[channel].pop(end)
    for channel in ("mcp", "pip"):  # 40 degrees a volt, rounded differently
        for name in ("gain", "offset"):
            assert stated[channel].pop(name) == pytest.approx(default[channel].pop(name), rel=1e-12)
    assert stated == default
    assert "thesis, equation 2.1" in sources["load_cell.gain"]
    limits = plain_section(rig.limits)
    assert set(limits.pop("sources")) == set(BENCH_LIMITS)
    assert limits == pytest.approx({k: v for k, v in plain_section(Limits()).items() if k != "sources"})


def test_scaling_is_the_one_of_the_thesis_and_the_data_sheets():
    daq = default_rig().daq
    assert daq.load_cell.quantity(0.475) == pytest.approx(0.0, abs=1e-3)  # 5.317 / 11.194 V at no load
    assert daq.load_cell.quantity(1.0) == pytest.approx(5.877)
    low, high = 0.05 * 5.0, 0.95 * 5.0  # KMA210: 5 to 95 % of 5 V over 180 degrees
    assert daq.mcp.quantity(high) - daq.mcp.quantity(low) == pytest.approx(math.pi)
    assert daq.current_monitor.volts(2.0) == pytest.approx(-1.6)  # 0.8 V/A, inverted
    assert daq.encoder.quantity(2150) == pytest.approx(math.pi / 2)
    assert daq.encoder.counts(2 * math.pi) == pytest.approx(8600)
    assert daq.command.volts(2.5) == 2.5
    assert daq.command.volts(99.0) == 10.0
    for channel in daq.inputs:
        assert channel.volts(channel.quantity(1.234)) == pytest.approx(1.234)


def test_signs_turn_the_quantity_around():
    rig = parse_rig("[daq.mcp]\nsign = -1\n[daq.encoder]\nsign = -1\n[daq.command]\nsign = -1\n", "x")
    same = Daq()
    assert rig.daq.mcp.quantity(3.0) == -same.mcp.quantity(3.0)
    assert rig.daq.encoder.counts(1.0) == -same.encoder.counts(1.0)
    assert rig.daq.command.volts(1.0) == -1.0
    assert rig.daq.command.current(rig.daq.command.volts(1.5)) == 1.5


def test_wiring_travels_in_the_session_and_old_rigs_have_the_defaults():
    rig = parse_rig(
        '[daq]\ndevice = "Dev7"\n[limits]\nspeed = { value = 90, unit = "deg/s", source = "mine" }', "x"
    )
    again = Rig.from_json(rig.to_json())
    assert again.daq.device == "Dev7"
    assert again.limits.speed == pytest.approx(math.pi / 2)
    assert again.limits.sources == {"speed": "mine"}
    assert again.limits.force == Limits().force
    old = Rig(None, Motor())
    assert old.daq == Daq()
    assert old.limits == Limits()
    assert "daq" not in old.extra


@pytest.mark.parametrize(
    ("terminal", "wiring", "second"),
    [
        ("ai0", "default", "ai8"),
        ("ai7", "diff", "ai15"),
        ("ai8", "default", "AI GND"),
        ("ai17", "default", "ai25"),
        ("ai31", "default", "AI GND"),
        ("ai3", "rse", "AI GND"),
        ("ai3", "nrse", "AI SENSE"),
        ("ai16", "nrse", "AI SENSE 2"),
        ("", "default", ""),
    ],
)
def test_what_an_input_is_measured_against_is_as_in_the_card_s_manual(terminal, wiring, second):
    assert second_terminal(AnalogInput(terminal, 1.0, wiring=wiring)) == second


def test_the_encoder_s_wires_are_named_and_stay_out_of_sessions_that_need_none():
    assert encoder_wires(Encoder()) == "A PFI8, B PFI10"
    assert encoder_wires(Encoder("ctr1", index=True)) == "A PFI3, B PFI11, Z PFI4"
    assert set(plain_section(Daq())["encoder"]) == {"terminal", "counts_per_turn", "sign", "index"}
    text = '[daq.encoder]\na = "PFI1"\nfilter_time = { value = 5.12, unit = "us", source = "mine" }\n'
    again = Rig.from_json(parse_rig(text, "x").to_json()).daq
    assert encoder_wires(again.encoder) == "A PFI1, B PFI10"
    assert again.encoder.filter_time == pytest.approx(5.12e-6)
    assert again.sources == {"encoder.filter_time": "mine"}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[daq]\ncard = 'Dev1'", r"\[daq\] holds the unknown 'card'; it knows device, server"),
        ("[daq]\ndevice = 1", "device is 1; it should be text in quotes"),
        ("[daq]\ntiming = 'fast'", "timing is 'fast'; it should be one of auto, single-point, buffered"),
        ("[daq]\nblock = 50", "block is 50; it should be 5 to 10 samples"),
        ("[daq]\nblock = 7.5", "block is 7.5; it should be a whole number"),
        ("[daq]\nrate_hz = 0", "rate_hz is 0; it should be above zero"),
        ("[daq.mcp]\nsign = 2", "mcp sign is 2; it should be 1 or -1"),
        ("[daq.mcp]\nsign = 0.5", "mcp sign is 0.5; it should be a whole number"),
        ("[daq.mcp]\ngain = 0", "mcp has a scaling of 0"),
        ("[daq.mcp]\ngain = {value = 1, unit = 'N/V'}", "in 'N/V'; it should be in 'rad/V'"),
        ("[daq.mcp]\nlow = 5\nhigh = -5", "mcp low is not below high"),
        ("[daq.mcp]\nwiring = 'loose'", "wiring is 'loose'"),
        ("[daq.mcp]\nterminal = 'ai9'\nwiring = 'diff'", "differential at ai9, which is no first half"),
        (
            "[daq.mcp]\nterminal = 'ai1'\nwiring = 'diff'\n[daq.pip]\nterminal = 'ai9'",
            "second terminal of mcp",
        ),
        ("[daq.encoder]\nfilter_time = {value = 3, unit = 'ms'}", "filter_time is 0.003 s; it should be 0"),
        ("[daq.mcp]\noffset = inf", "offset is inf; it should be a finite number"),
        ("[daq.command]\nlow = 1", "command leaves out 0 V"),
        ("[daq.enable]\nactive_high = 1", "active_high is 1; it should be true or false"),
        ("[daq.enable]\nterminal = ''", "enable has no terminal"),
        ("daq = 3", r"\[daq\] is not a section"),
        ("[limits]\ncurrent = -1", "current is -1; it should be above zero"),
        ("[limits]\nmcp_low = 2\nmcp_high = 1", "mcp_low is not below mcp_high"),
        ("[limits]\nheat = 2", "holds the unknown 'heat'"),
        ("limits = 3", r"\[limits\] is not a section"),
    ],
)
def test_impossible_wiring_is_one_sentence(text, sentence):
    with pytest.raises(UserError, match=sentence):
        parse_rig(text, "rig.toml")
