"""What is found at the start, said in a sentence, whatever is missing; and what a device's name means."""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import Any

import grpc
import pytest

from fingerlab.core.errors import UserError
from fingerlab.devices.choosing import DeviceChoice, choose_device, detect, opening_sentence, refuse_unknown
from fingerlab.devices.faults import Faults
from fingerlab.devices.ni.card import NiCard
from fingerlab.devices.protocol import VirtualClock
from fingerlab.devices.replay import Replay
from fingerlab.devices.simulated import SimulatedRig, Simulation
from fingerlab.rig.file import Rig, parse_rig

from .virtual_card import Card, InProcessChannel, Servicer, SimplePlant, TcpServer


def channel_to(card: Card) -> InProcessChannel:
    return InProcessChannel(Servicer(card))


def test_no_driver_is_said_and_the_simulated_rig_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    from nidaqmx import _lib

    def missing() -> None:
        raise _lib.DaqNotFoundError(_lib._DAQ_NOT_FOUND_MESSAGE)

    monkeypatch.setattr(_lib.DaqLibImporter, "_import_lib", lambda self: missing())
    card, simulated = detect()
    assert (card.name, card.available) == ("Dev1", False)
    assert card.sentence.startswith("no NI-DAQmx driver: using the simulated rig (Could not find")
    assert simulated.available
    assert opening_sentence((card, simulated)) == card.sentence
    assert choose_device(None).kind == "simulated"


def test_a_card_is_found() -> None:
    found = detect(channel=channel_to(Card(SimplePlant())))
    assert [f.available for f in found] == [True, True]
    assert opening_sentence(found) == "Dev1: PCIe-6343, serial number 1C0FFEE"


def test_another_card_or_a_simulated_one() -> None:
    card = Card(SimplePlant(), name="Dev4")
    found = detect(channel=channel_to(card))[0]
    assert not found.available
    assert "knows no card Dev1 (it knows Dev4): using the simulated rig" in found.sentence
    card = Card(SimplePlant())
    card.simulated = True
    found = detect(channel=channel_to(card))[0]
    assert not found.available
    assert "simulated device of NI MAX, whose encoder stands still" in found.sentence
    card.name = ""
    assert "(it knows none)" in detect(channel=channel_to(card))[0].sentence


@pytest.mark.parametrize("status", [grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED])
def test_a_dead_server(status: grpc.StatusCode) -> None:
    channel = channel_to(Card(SimplePlant()))
    channel.lost = status
    found = detect(parse_rig('[daq]\nserver = "bench:31763"', "x"), channel)[0]
    assert not found.available
    assert found.sentence.startswith("the device server bench:31763 does not answer: using the simulated rig")


def test_a_dead_port_of_this_machine() -> None:
    server = TcpServer(Servicer(Card(SimplePlant())))
    server.stop()
    found = detect(parse_rig(f'[daq]\nserver = "{server.address}"', "x"))[0]
    assert not found.available
    assert "does not answer" in found.sentence


def test_detection_never_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    impossible = Rig(None, parse_rig("", "x").motor, extra={"daq": {"block": 99}})
    assert "block is 99" in detect(impossible)[0].sentence

    class Broken:
        def unary_unary(self, *_: Any, **__: Any) -> Any:
            raise RuntimeError("a driver that is in pieces")

    assert "the NI-DAQmx driver failed" in detect(channel=Broken())[0].sentence
    monkeypatch.setitem(sys.modules, "nidaqmx", None)
    monkeypatch.setitem(sys.modules, "nidaqmx.errors", None)
    assert "nidaqmx cannot be loaded" in detect()[0].sentence
    monkeypatch.setitem(sys.modules, "fingerlab.twin.recording", None)
    found = detect()
    assert not found[1].available
    assert "simulated rig cannot be used" in opening_sentence(found)


def test_nidaqmx_is_not_loaded_before_a_card_is_asked_for() -> None:
    code = (
        "import sys, fingerlab.devices, fingerlab.devices.choosing, fingerlab.devices.choosing, "
        "fingerlab.devices.simulated, fingerlab.devices.protocol, fingerlab.devices.ni.card\n"
        "assert not {'nidaqmx', 'grpc'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_names_of_devices(make_session: Any) -> None:
    path = make_session()
    replay = choose_device(f"replay:{path}#002", real_time=False).build()
    assert isinstance(replay, Replay)
    assert replay.name.endswith("run 002")
    card = choose_device("Dev7").build()
    assert isinstance(card, NiCard)
    assert card.name == "Dev7"
    assert choose_device("bench:31763/Dev2").build().name == "Dev2 at bench:31763"
    rig = parse_rig('[daq]\nserver = "there:1"\n[daq.encoder]\nsign = -1', "x")
    kept = choose_device("Dev2", rig).rig
    assert kept is not None
    assert (kept.daq.server, kept.daq.encoder.sign) == ("there:1", -1)
    for wrong in ("replay:", "", "host/Dev1"):
        with pytest.raises(UserError, match="give"):
            choose_device(wrong)


def test_a_card_that_the_driver_does_not_list_is_refused_with_what_it_lists() -> None:
    card = Card(SimplePlant(), name="Dev4")
    refuse_unknown(choose_device("Dev4"), channel_to(card))
    with pytest.raises(UserError, match=r"no device 'simulatd': .* Dev4; give one of these, 'simulated'"):
        refuse_unknown(choose_device("simulatd"), channel_to(card))
    card.name = ""
    with pytest.raises(UserError, match=r"no device 'Dev1' at bench:1: no NI-DAQmx driver lists"):
        refuse_unknown(choose_device("bench:1/Dev1"), channel_to(card))
    refuse_unknown(choose_device("simulated"))


def test_a_server_that_does_not_answer_is_no_reason_to_refuse_a_name() -> None:
    channel = channel_to(Card(SimplePlant()))
    channel.lost = grpc.StatusCode.UNAVAILABLE
    refuse_unknown(choose_device("bench:31763/Dev1"), channel)  # opening it says so
    refuse_unknown(choose_device("127.0.0.1:1/Dev1"))


def test_a_choice_can_be_handed_to_another_process() -> None:
    choice = DeviceChoice(
        "simulated", simulation=Simulation(seed=4), faults=Faults(lost={5: 2}), real_time=False
    )
    raw = []
    for one in (choice, pickle.loads(pickle.dumps(choice))):
        device = one.build(VirtualClock())
        assert isinstance(device, SimulatedRig)
        device.open()
        device.start()
        device.set_enable(True)
        raw.append([device.exchange(0.4) for _ in range(50)])
    assert raw[0] == raw[1]
    assert raw[0][-1].index == 51


def test_a_server_over_tcp_and_its_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once over a real port: the loop in blocks, and the server's end as a lost device."""
    monkeypatch.setattr("fingerlab.devices.ni.connection.RPC_DEADLINE", 30.0)  # other tests share the machine
    from fingerlab.devices.protocol import DeviceLost

    plant_card = Card(SimplePlant())
    server = TcpServer(Servicer(plant_card))
    try:
        rig = parse_rig(f'[daq]\nserver = "{server.address}"', "x")
        assert detect(rig)[0].available
        device = NiCard(rig, VirtualClock())
        device.open()
        assert device.cycles_per_command == 10  # a network is too slow for single points
        device.start()
        device.set_enable(True)
        samples = [device.exchange(0.5) for _ in range(200)]
        assert [s.index for s in samples] == list(range(200))
        assert samples[-1].raw[:2] == pytest.approx((0.02, 1.02))
        assert (plant_card.volts, plant_card.line) == (0.5, True)
    finally:
        server.stop()
    with pytest.raises(DeviceLost, match="the device server does not answer"):
        device.exchange(0.5)
    assert not device.make_safe()
    device.close()
