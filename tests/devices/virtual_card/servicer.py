"""The device server's calls, answered by a :class:`Card`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as messages
from nidaqmx._stubs.nidaqmx_pb2_grpc import NiDAQmxServicer
from session_pb2 import Session

from .card import SINGLE_POINT, Card, DaqFailure

NOT_YET = -200284
SYSTEM_STRINGS = {0x193B: lambda card: card.name}
SYSTEM_NUMBERS = {0x1272: lambda card: 24, 0x1923: lambda card: 8, 0x2F22: lambda card: 0}
DEVICE_STRINGS = {0x631: lambda card: card.product}
DEVICE_NUMBERS = {0x632: lambda card: card.serial}
DEVICE_FLAGS = {0x22CA: lambda card: card.simulated}
TASK_STRINGS = {
    0x1276: lambda task: task.name,
    0x1273: lambda task: ", ".join(c.terminal for c in task.channels),
}
TASK_NUMBERS = {0x2181: lambda task: len(task.channels)}
READ_NUMBERS = {0x192A: lambda task: task.total}
READ_COUNTS = {0x1223: lambda task: len(task.samples)}
CHANNEL_TYPES = {"ai": 10100, "ao": 10102, "ci": 10131, "do": 10153, "di": 10151}


class Servicer(NiDAQmxServicer):
    """Every RPC counts itself in ``calls``, runs the card's hook of its name, and turns codes into status."""

    def __init__(self, card: Card) -> None:
        self.card = card
        self.calls: dict[str, int] = {}


def _rpc(name: str, work: Callable[[Card, Any], Any]) -> None:
    answer = getattr(messages, f"{name}Response")

    def call(self: Servicer, request: Any, context: Any) -> Any:
        self.calls[name] = self.calls.get(name, 0) + 1
        try:
            if name in self.card.hooks:
                self.card.hooks[name]()
            return answer(**(work(self.card, request) or {}))
        except DaqFailure as failure:
            context.set_trailing_metadata((("ni-error", str(failure.code)),))
            context.abort(grpc.StatusCode.UNKNOWN, str(failure))

    setattr(Servicer, name, call)


def _create(card: Card, request: Any) -> dict[str, Any]:
    card.create(request.session_name)
    return {"task": Session(name=request.session_name), "new_session_initialized": True}


def _attribute(table: dict[int, Callable[[Any], Any]], which: str) -> Callable[[Card, Any], dict[str, Any]]:
    def get(card: Card, request: Any) -> dict[str, Any]:
        if which == "device" and request.device_name != card.name:
            raise DaqFailure(-200220)
        code = request.attribute_raw or request.attribute
        if code not in table:
            raise DaqFailure(-200452)
        return {"value": table[code](card.task(request.task.name) if which == "task" else card)}

    return get


def _read_analog(card: Card, request: Any) -> dict[str, Any]:
    task = card.task(request.task.name)
    if task.mode == SINGLE_POINT:
        point = card.read_point(task.name, request.timeout)
        if point is None:
            return {"status": NOT_YET, "read_array": [], "samps_per_chan_read": 0}
        return {"read_array": point, "samps_per_chan_read": 1}
    wanted = request.num_samps_per_chan
    rows = card.read_block(task.name, wanted, request.timeout)
    read = len(rows)
    columns = list(zip(*rows, strict=True)) if rows else [() for _ in task.channels]
    flat = [value for column in columns for value in column]
    if read < wanted and card.layout == "rows":
        nan = float("nan")
        flat = [v for column in columns for v in (*column, *([nan] * (wanted - read)))]
    elif read < wanted and card.layout == "zeros":
        flat += [0.0] * (wanted * len(columns) - len(flat))
    return {"status": 0 if read == wanted else NOT_YET, "read_array": flat, "samps_per_chan_read": read}


def _read_counts(card: Card, request: Any) -> dict[str, Any]:
    values = card.read_block(request.task.name, request.num_samps_per_chan, request.timeout)
    status = 0 if len(values) == request.num_samps_per_chan else NOT_YET
    return {"status": status, "read_array": values, "samps_per_chan_read": len(values)}


def _read_count(card: Card, request: Any) -> dict[str, Any]:
    value = card.read_point(request.task.name, request.timeout)
    if value is None:
        raise DaqFailure(NOT_YET)
    return {"value": value}


def _control(card: Card, request: Any) -> None:
    if request.action_raw in (3, 4):  # commit, reserve
        card.reserve(request.task.name)


def _write_lines(card: Card, request: Any) -> dict[str, Any]:
    card.write_line(request.task.name, request.write_array[-1] != 0)
    return {"samps_per_chan_written": 1}


def _read_lines(card: Card, request: Any) -> dict[str, Any]:
    levels = card.read_levels(request.task.name)
    return {"read_array": bytes(levels), "samps_per_chan_read": 1, "num_bytes_per_samp": 1}


def _reset(card: Card, request: Any) -> None:
    if request.device_name != card.name:
        raise DaqFailure(-200220)
    card.reset()


def _set_attribute(card: Card, request: Any) -> None:
    card.task(request.task.name).attributes[request.attribute_raw or request.attribute] = request.value


def _channel_type(card: Card, request: Any) -> dict[str, Any]:
    return {"value_raw": CHANNEL_TYPES[card.task(request.task.name).kind]}


for _name, _work in {
    "CreateTask": _create,
    "ClearTask": lambda card, r: card.clear(r.task.name),
    "StartTask": lambda card, r: card.start(r.task.name),
    "StopTask": lambda card, r: card.stop(r.task.name),
    "TaskControl": _control,
    "ResetDevice": _reset,
    "CreateAIVoltageChan": lambda c, r: c.add(r.task.name, "ai", r.physical_channel, r.min_val, r.max_val),
    "CreateAOVoltageChan": lambda c, r: c.add(r.task.name, "ao", r.physical_channel, r.min_val, r.max_val),
    "CreateCIAngEncoderChan": lambda card, r: card.add(r.task.name, "ci", r.counter),
    "CreateDOChan": lambda card, r: card.add(r.task.name, "do", r.lines),
    "CreateDIChan": lambda card, r: card.add(r.task.name, "di", r.lines),
    "ReadDigitalLines": _read_lines,
    "CfgSampClkTiming": lambda card, r: card.time(
        r.task.name, r.sample_mode_raw or r.sample_mode, r.source, r.samps_per_chan
    ),
    "ReadAnalogF64": _read_analog,
    "ReadAnalogScalarF64": lambda card, r: {"value": card.read_now(r.task.name)},
    "ReadCounterScalarF64": _read_count,
    "ReadCounterF64Ex": _read_counts,
    "WriteAnalogScalarF64": lambda card, r: card.write_volts(r.task.name, r.value, r.auto_start),
    "WriteDigitalLines": _write_lines,
    "GetSystemInfoAttributeString": _attribute(SYSTEM_STRINGS, "system"),
    "GetSystemInfoAttributeUInt32": _attribute(SYSTEM_NUMBERS, "system"),
    "GetDeviceAttributeString": _attribute(DEVICE_STRINGS, "device"),
    "GetDeviceAttributeUInt32": _attribute(DEVICE_NUMBERS, "device"),
    "GetDeviceAttributeBool": _attribute(DEVICE_FLAGS, "device"),
    "GetTaskAttributeString": _attribute(TASK_STRINGS, "task"),
    "GetTaskAttributeUInt32": _attribute(TASK_NUMBERS, "task"),
    "GetReadAttributeUInt32": _attribute(READ_COUNTS, "task"),
    "GetReadAttributeUInt64": _attribute(READ_NUMBERS, "task"),
    "GetChanAttributeInt32": _channel_type,
    "SetChanAttributeString": _set_attribute,
    "SetChanAttributeDouble": _set_attribute,
    "SetChanAttributeBool": _set_attribute,
    "GetErrorString": lambda card, r: {"error_string": f"Driver's text for {r.error_code}."},
}.items():
    _rpc(_name, _work)
