"""A virtual card with something on its connector, and the real nidaqmx package to drive it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fingerlab.devices.ni.card import NiCard
from fingerlab.rig.file import Rig, parse_rig

from .virtual_card import Card, DaqFailure, InProcessChannel, Servicer, SimplePlant

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


def failing(code: int) -> Callable[[], None]:
    def fail() -> None:
        raise DaqFailure(code)

    return fail
