"""Stands for ``check-rig`` in fault tests: a willing operator, and of the steps those that are asked for.

``python -m tests.faults.checker CARD STEP...`` checks the virtual card at the address CARD as the command
does. It prints a line of JSON where a step asks (its id), and where something is told, with the processes of
the bench.
"""

from __future__ import annotations

import json
import sys

import psutil

from fingerlab.acquisition.check_rig.look import Outcome
from fingerlab.acquisition.check_rig.walk import STEPS
from fingerlab.cli.bench import checked
from fingerlab.devices.choosing import choose_device
from fingerlab.rig.file import default_rig
from tests.devices.safety_wiring import wired

LINES = {"lines", "dead_man"}
"""Steps of what the default rig does not wire."""


class Willing:
    """Says yes, and tells what was asked."""

    def tell(self, text: str) -> None:
        """What was found, in a line; first of all that the bench is open."""
        children = [child.pid for child in psutil.Process().children()]
        print(json.dumps({"told": text, "children": children}), flush=True)

    def found(self, outcome: Outcome) -> None:
        self.tell(f"{outcome.state}: {outcome.title}. {outcome.sentence}")

    def ask(self, step: str, question: str) -> str:
        """Every question is answered at once."""
        print(json.dumps({"asked": step}), flush=True)
        return "yes"


def main(card: str, *names: str) -> None:
    """As ``fingerlab check-rig`` does it, without its terminal and its file."""
    try:
        rig = wired(default_rig()) if LINES.intersection(names) else None
        steps = [one for one in STEPS if one.name in names]
        checked(choose_device(f"{card}/Dev1", rig), Willing(), "test", steps)
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main(*sys.argv[1:])
