"""Acquire in a narrow window: numbers with their units, and the device by its name."""

from __future__ import annotations

import re

import pytest

from ..bench_hands import Rig


def errors_seen(rig: Rig) -> str:
    """What the error of the torque reads, as it is drawn."""
    label = rig.tab.plots.panes["torque"].error
    assert label.isVisible()
    return label.seen


def modelled(rig: Rig, width: int) -> None:
    """A motion beside the nominal model, in a window of this width, px."""
    rig.start()
    rig.tab.toolbar.model_chosen.emit("nominal")
    rig.window.resize(width, 700)
    rig.run(3.0)


@pytest.mark.parametrize("width", [1024, 1280])
def test_the_error_of_the_model_has_its_unit(connect_rig, width: int) -> None:  # type: ignore[no-untyped-def]
    rig = connect_rig()
    modelled(rig, width)
    assert re.fullmatch(r"(error|±) \d+\.\d mN m", errors_seen(rig))
    panes = rig.tab.plots.panes
    panes["torque"].error.show_value(1.2345)  # more digits than ever before: it makes room
    assert re.fullmatch(r"(error|±) 1234\.5 mN m", errors_seen(rig))
    assert not panes["angles"].error.isVisible()  # nothing of it is modelled
    assert not panes["displacement"].error.isVisible()


def test_with_larger_letters_too(larger_letters, connect_rig) -> None:  # type: ignore[no-untyped-def]
    rig = connect_rig()
    modelled(rig, 1024)
    assert re.fullmatch(r"(error|±) \d+\.\d mN m", errors_seen(rig))
    assert "root mean square" in rig.tab.plots.panes["torque"].error.toolTip()
    assert rig.tab.header.name.seen == "Simulated rig"


def test_the_device_is_named_whole(connect_rig) -> None:  # type: ignore[no-untyped-def]
    rig = connect_rig()
    rig.window.resize(1024, 700)
    rig.run(0.2)
    header = rig.tab.header
    assert header.name.seen == "Simulated rig"
    assert "Emergency stop released" in header.lines.toolTip()
    assert "…" not in header.lines.seen
    header.show_lines({"emergency stop": "pressed", "amplifier": "ready", "dead-man": "not wired"})
    assert "Emergency stop pressed" in header.lines.wordings[2]
    header.show_device("a device with a name that is longer than any window has room for", False)
    assert header.name.seen.endswith("…")
    assert "longer than any window" in header.name.toolTip()
