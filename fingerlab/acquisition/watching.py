"""What has to be told of a bench, from one look at it to the next: stops, gaps, a disk that fills."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from fingerlab.acquisition.bench import Status
from fingerlab.acquisition.board import Input
from fingerlab.acquisition.recording import seconds_of_room

LITTLE_ROOM_S = 1800.0
"""Half an hour of recording, a protocol of the thesis and more (assumed)."""


class Kind(Enum):
    """What a notice is about."""

    STOPPED = "stopped"
    RECORDER = "recorder"
    LOST = "lost"
    ROOM = "room"
    UNREAD = "unread"
    LINE = "line"
    SLEEP = "sleep"


@dataclass(frozen=True)
class Notice:
    """One sentence for the operator."""

    kind: Kind
    sentence: str
    fault: bool = False


def endangered(status: Status, rate_hz: float) -> str:
    """What endangers the recording now, in few words; empty for nothing."""
    parts = []
    if status.unread:
        parts.append(f"{status.unread} samples lost")
    if status.lost:
        parts.append(f"{status.lost} cycles lost")
    room = seconds_of_room(status.free_bytes, rate_hz) if status.free_bytes else math.inf
    if room < LITTLE_ROOM_S:
        parts.append(f"room for {room / 60.0:.0f} min of recording")
    return ", ".join(parts)


def notices(before: Status, now: Status, rate_hz: float) -> tuple[Notice, ...]:
    """What is new since the last look."""
    told = []
    if now.faults != before.faults or (now.loop_ended and not before.loop_ended):
        sentence = now.fault or "The control loop has ended; connect the device again."
        told.append(Notice(Kind.STOPPED, sentence, fault=True))
    elif now.latched and not before.latched:
        told.append(Notice(Kind.STOPPED, "The bench was stopped by the operator."))
    if now.recorder and now.recorder != before.recorder:
        told.append(Notice(Kind.RECORDER, now.recorder))
    if now.recording and now.lost > before.lost:
        sentence = f"{now.lost - before.lost} cycles lost; the recording has a gap there"
        told.append(Notice(Kind.LOST, sentence))
    told.extend(_of_lines(before, now, rate_hz))
    if now.sleep and now.sleep != before.sleep:
        told.append(Notice(Kind.SLEEP, now.sleep))
    told.extend(_of_room(before, now, rate_hz))
    if now.unread > before.unread:
        sentence = (
            f"The recorder was too slow: {now.unread} samples are lost and stored as a gap; close other "
            "programs or record to a faster disk."
        )
        told.append(Notice(Kind.UNREAD, sentence))
    return tuple(told)


STOP_WORDS = {Input.NONE: "not wired", Input.NO: "released", Input.YES: "pressed"}
READY_WORDS = {Input.NONE: "not wired", Input.NO: "not ready", Input.YES: "ready"}
DEAD_MAN_WORDS = {False: "not wired", True: "wired"}
"""The digital lines of a bench as they are shown."""


def line_words(status: Status) -> dict[str, str]:
    """State of the emergency stop, of the amplifier and of the dead-man, in words."""
    beating = status.dead_man and status.enabled
    return {
        "emergency stop": STOP_WORDS[status.emergency_stop],
        "amplifier": READY_WORDS[status.amplifier_ready],
        "dead-man": "beating" if beating else DEAD_MAN_WORDS[status.dead_man],
    }


def _of_lines(before: Status, now: Status, rate_hz: float) -> tuple[Notice, ...]:
    """An input that changed, with the bench's time; not what it is when it is first seen."""
    changes = (
        ("The emergency stop was", before.emergency_stop, now.emergency_stop, STOP_WORDS),
        ("The amplifier is", before.amplifier_ready, now.amplifier_ready, READY_WORDS),
    )
    at = f"at {now.lines_at / rate_hz:.3f} s of the bench's time"
    return tuple(
        Notice(Kind.LINE, f"{begins} {words[is_now]} {at}.")
        for begins, was, is_now, words in changes
        if was is not is_now and was is not Input.NONE
    )


def _of_room(before: Status, now: Status, rate_hz: float) -> tuple[Notice, ...]:
    """Once, when the room becomes little, or is when it is first known."""
    if not now.free_bytes:
        return ()
    room = seconds_of_room(now.free_bytes, rate_hz)
    known = seconds_of_room(before.free_bytes, rate_hz) if before.free_bytes else math.inf
    if not room < LITTLE_ROOM_S <= known:
        return ()
    sentence = (
        f"The disk has room for {room / 60:.0f} more minutes of recording; make room, or choose another "
        "folder."
    )
    return (Notice(Kind.ROOM, sentence),)
