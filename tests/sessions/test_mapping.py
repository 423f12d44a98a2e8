"""Which column is which channel."""

from __future__ import annotations

import json
import math

import pytest

from fingerlab.core.errors import UserError
from fingerlab.sessions.mapping import likely_columns, map_columns
from fingerlab.sessions.text_table import inspect_table

BENCH_HEADER = "time (s)\tcommand (deg)\tposition (deg)\ttorque (Nm)\tMCP (deg)\tPIP (deg)\tforce (N)"


def table_with(tmp_path, header, columns=7):
    path = tmp_path / "a.txt"
    rows = "\t".join(["0.5"] * (header.count("\t") + 1 if header else columns))
    path.write_text(f"{header}\n{rows}\n{rows}\n" if header else f"{rows}\n{rows}\n", encoding="utf-8")
    return inspect_table(path)


def found(columns):
    return {c.channel: (c.index, c.unit, c.factor) for c in columns}


DEGREE = math.pi / 180
BENCH = {
    "time": (0, "s", 1.0),
    "motor_command": (1, "deg", DEGREE),
    "motor_position": (2, "deg", DEGREE),
    "motor_torque": (3, "Nm", 1.0),
    "mcp_angle": (4, "deg", DEGREE),
    "pip_angle": (5, "deg", DEGREE),
    "endpoint_force": (6, "N", 1.0),
}


def test_the_benchs_header(tmp_path):
    assert found(map_columns(table_with(tmp_path, BENCH_HEADER), None)) == BENCH
    assert found(map_columns(table_with(tmp_path, BENCH_HEADER), "auto")) == BENCH


def test_the_benchs_order_without_a_header(tmp_path):
    columns = map_columns(table_with(tmp_path, ""), None)
    assert {c.channel: (c.index, c.factor) for c in columns} == {k: (v[0], v[2]) for k, v in BENCH.items()}
    assert all("unit assumed" in c.source for c in columns)
    with pytest.raises(UserError, match=r"has no header and 5 columns; say which is which with --map"):
        map_columns(table_with(tmp_path, "", 5), None)


@pytest.mark.parametrize(
    ("header", "channel", "factor"),
    [
        ("t [ms]", "time", 1e-3),
        ("Zeit / s", "time", 1.0),
        ("desired angle (rad)", "motor_command", 1.0),
        ("Motor position (°)", "motor_position", DEGREE),
        ("motor current [mA]", "motor_current", 1e-3),
        ("Torque (mNm)", "motor_torque", 1e-3),
        ("load torque (N m)", "load_torque", 1.0),
        ("theta_MCP", "mcp_angle", DEGREE),
        ("Load Cell (N)", "endpoint_force", 1.0),
        ("pip_angle (rad)", "pip_angle", 1.0),
        ("raw/pip (V)", "raw/pip", 1.0),
        ("Room temperature (degC)", "room_temperature", 1.0),
    ],
)
def test_headers_that_people_write(tmp_path, header, channel, factor):
    columns = map_columns(table_with(tmp_path, f"nonsense\t{header}"), None)
    assert (columns[1].channel, columns[1].factor) == (channel, pytest.approx(factor))


def test_what_a_dialog_starts_from_reads_a_unit_behind_the_name(tmp_path):
    header = "t_ms\tmotor_current_mA\tmcp_deg\tkraft_N\tmotor_v"
    likely = likely_columns(table_with(tmp_path, header))
    assert [one and (one.channel, one.unit) for one in likely[:4]] == [
        ("time", "ms"), ("motor_current", "mA"), ("mcp_angle", "deg"), ("endpoint_force", "N"),
    ]  # fmt: skip
    assert likely[1].factor == 1e-3
    assert likely[4].channel == "motor_v"  # a velocity more likely than volts


def test_inline_json_and_toml_say_the_same(tmp_path):
    table = table_with(tmp_path, BENCH_HEADER)
    (tmp_path / "m.json").write_text(
        json.dumps({"time": 1, "mcp_angle": {"column": "MCP", "unit": "deg"}, "pip_angle":
                    {"column": 6, "unit": "rad", "scale": -1}}), encoding="utf-8"
    )  # fmt: skip
    (tmp_path / "m.toml").write_text(
        'time = 1\nmcp_angle = {column = "MCP (deg)"}\npip_angle = {column=6, unit="rad", scale=-1}\n',
        encoding="utf-8",
    )
    inline = "time=1, mcp_angle=mcp:deg, pip_angle=6:rad:-1"
    wanted = {"time": (0, "s", 1.0), "mcp_angle": (4, "deg", DEGREE), "pip_angle": (5, "rad", -1.0)}
    for mapping in (inline, str(tmp_path / "m.json"), str(tmp_path / "m.toml")):
        assert found(map_columns(table, mapping)) == wanted


@pytest.mark.parametrize(
    ("mapping", "sentence"),
    [
        ("nonsense", "neither 'auto' nor a .json or .toml file nor a text such as"),
        ("time=9", "takes 'time' from column 9, but .*a.txt has columns 1 to 7"),
        ("time=0", "from column 0"),
        ("time=tempo", "from the header 'tempo', but .* has time \\(s\\), command"),
        ("time=1:parsec", "taken as 'time' in 'parsec'; it should be in one of s, sec, ms"),
        ("mcp_angle=5:N", "in 'N'; it should be in one of rad"),
        ("time=1,time=2", "names 'time' twice"),
        ("time=", "holds 'time='; each part should read CHANNEL=COLUMN"),
        ("time=1:s:0", "scales 'time' by '0'"),
        ("time=1:s:x", "scales 'time' by 'x'"),
        ("mcp angle=1", "names the channel 'mcp angle'"),
        ("none.json", "none.json cannot be read"),
    ],
)
def test_a_mapping_that_does_not_fit(tmp_path, mapping, sentence):
    with pytest.raises(UserError, match=sentence):
        map_columns(table_with(tmp_path, BENCH_HEADER), mapping)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("m.json", "{"),
        ("m.toml", "= 1"),
        ("m.json", "[]"),
        ("m.json", '{"time": [1]}'),
        ("m.json", '{"time": {"col": 1}}'),
    ],
)
def test_a_mapping_file_that_does_not_fit(tmp_path, name, text):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(UserError):
        map_columns(table_with(tmp_path, BENCH_HEADER), str(tmp_path / name))


def test_two_columns_for_one_channel_are_not_guessed(tmp_path):
    with pytest.raises(UserError, match="columns 1 and 2 both look like 'motor_torque'"):
        map_columns(table_with(tmp_path, "torque (Nm)\tdrive torque (Nm)"), None)


def test_a_header_is_asked_of_a_file_without_one(tmp_path):
    with pytest.raises(UserError, match="has no header; give the column by its number"):
        map_columns(table_with(tmp_path, ""), "time=t")
