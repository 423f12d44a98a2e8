"""The state machine: its table against what the bench may do, whatever happens in whatever order."""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from fingerlab.acquisition.control.machine import MODE_WORDS, TRANSITIONS, Event, Machine, Mode


class AnyOrder(RuleBasedStateMachine):
    """A second, independent account of what an operator has earned, beside the machine itself."""

    def __init__(self) -> None:
        super().__init__()
        self.machine = Machine()
        self.referenced = self.enabled_by_hand = self.asked_to_move = self.stop_pressed = False

    @rule(event=st.sampled_from(Event))
    def happens(self, event: Event) -> None:
        before, self.machine = self.machine, self.machine.after(event)
        if event in (Event.FAULT, Event.STOP):
            self.enabled_by_hand = self.asked_to_move = False
            self.stop_pressed = self.stop_pressed or event is Event.STOP
            assert not self.machine.command_allowed
            assert not self.machine.enable_allowed
        elif event is Event.RELEASE and not self.machine.enable_allowed:
            self.stop_pressed = False
        elif event is Event.INITIALISE and not self.machine.enable_allowed and before.mode is not Mode.FAULT:
            self.referenced = True
        elif event is Event.FORGET and not self.machine.enable_allowed:
            self.referenced = False
        elif event is Event.ENABLE and self.referenced and not self.stop_pressed:
            self.enabled_by_hand = True
        elif event is Event.DISABLE:
            self.enabled_by_hand = self.asked_to_move = False
        elif event is Event.RUN and self.enabled_by_hand:
            self.asked_to_move = True
        elif event is Event.REST and before.mode is Mode.STOPPING:
            self.asked_to_move = False

    @invariant()
    def the_motor_moves_only_where_it_may(self) -> None:
        if self.machine.command_allowed:
            assert self.machine.enable_allowed
            assert self.asked_to_move
        if self.machine.enable_allowed:
            assert self.referenced
            assert self.enabled_by_hand
            assert not self.stop_pressed
        assert self.machine.latched == self.stop_pressed


AnyOrder.TestCase.settings = settings(max_examples=80, stateful_step_count=50, deadline=None)
TestAnyOrder = AnyOrder.TestCase


@pytest.mark.parametrize(("referenced", "least"), [(True, 3), (False, 4)])
def test_no_way_from_a_fault_to_current_but_by_reset_enable_and_run(referenced: bool, least: int) -> None:
    reached = {Machine(Mode.FAULT, latched, referenced=referenced) for latched in (False, True)}
    for steps in range(1, 5):
        reached = {machine.after(event) for machine, event in product(reached, Event)}
        assert any(machine.command_allowed for machine in reached) == (steps >= least)


def test_references_outlast_a_stop_and_a_fault_but_not_a_counter_that_stood_still() -> None:
    running = Machine()
    for event in (Event.INITIALISE, Event.ENABLE, Event.RUN):
        running = running.after(event)
    assert running.after(Event.STOP).mode is Mode.INITIALISED
    assert running.after(Event.STOP).after(Event.FORGET).mode is Mode.IDLE
    fault = running.after(Event.FAULT)
    assert fault.after(Event.RESET).mode is Mode.INITIALISED
    assert fault.after(Event.FORGET).after(Event.RESET).mode is Mode.IDLE


def test_stop_and_fault_are_known_everywhere_and_take_the_current_away() -> None:
    for mode, latched in product(Mode, (False, True)):
        for event in (Event.STOP, Event.FAULT):
            after = Machine(mode, latched).after(event)
            assert not after.command_allowed
            assert not after.enable_allowed
        assert Machine(mode, latched).after(Event.STOP).latched


def test_a_stop_stays_until_it_is_released() -> None:
    machine = Machine(Mode.RUNNING).after(Event.STOP)
    for event in set(Event) - {Event.RELEASE}:
        assert machine.after(event).latched
    assert "release" in machine.after(Event.INITIALISE).refusal(Event.ENABLE)
    ready = machine.after(Event.INITIALISE)
    assert not ready.after(Event.ENABLE).enable_allowed
    assert ready.after(Event.RELEASE).after(Event.ENABLE).mode is Mode.ENABLED


def test_every_refusal_is_a_sentence_that_names_the_mode() -> None:
    for mode, event in product(Mode, Event):
        sentence = Machine(mode).refusal(event)
        if (mode, event) in TRANSITIONS:
            assert sentence == ""
        else:
            assert MODE_WORDS[mode] in sentence
            assert sentence.endswith(".")
            assert Machine(mode).after(event) == Machine(mode)
