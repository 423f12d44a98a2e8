"""Hundreds of kills at random moments, counted in ``docs/faults.md``.

``python -m tests.faults.sweep [KILLS] [SEED] [--card | --trial] [--keep FILE]`` (500 and 1 by default; some
five seconds each, ten with ``--card``, thirty with ``--trial``). With ``--keep`` a sweep can be taken in
pieces: outcomes are added to the file and counted as a whole. The tables of the page that were counted are
written anew; the words between are the page's own. With no kills and nothing kept, the tables of the other
faults alone are taken.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.injected import table
from tests.faults.killing import VICTIMS, kill_once
from tests.faults.killing_checks import STEPS, NotSoFar, kill_check
from tests.faults.killing_trials import MOMENTS, kill_trial, rows_of_trials
from tests.faults.live_card import served
from tests.prediction.trial_model import model_with_effect

PAGE = Path(__file__).resolve().parents[2] / "docs" / "faults.md"
LIMIT_MS, LIMIT_S = 50.0, 0.25
TRIES = 5
"""How often a check is begun that a busy machine's late loop has ended before its step."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kills", nargs="?", type=int, default=500)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="JSON lines of outcomes: added to, and counted as a whole")
    parser.add_argument("--victim", choices=VICTIMS, help="only this one; each in its turn without it")
    parser.add_argument(
        "--card", action="store_true", help="at the virtual card, and check-rig in each step, too"
    )
    parser.add_argument("--trial", action="store_true", help="a force trial, in each of its moments")
    options = parser.parse_args()
    chance = random.Random(options.seed)
    outcomes: list[dict[str, Any]] = []
    if options.keep and options.keep.exists():
        outcomes = [json.loads(line) for line in options.keep.read_text(encoding="utf-8").splitlines()]
    kills = kills_at_the_card if options.card else kills_at_the_fake_bench
    kills = kills_of_a_trial if options.trial else kills
    for number, outcome in enumerate(kills(options, chance)):
        outcomes.append(outcome)
        if options.keep:
            with options.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(outcome) + "\n")
        print(number + 1, outcome, file=sys.stderr)
    text = PAGE.read_text(encoding="utf-8")
    if options.trial:
        PAGE.write_text(with_part(text, "kills of a force trial", rows_of_trials(outcomes)), encoding="utf-8")
        return
    if outcomes:
        text = with_part(text, "kills at the card" if options.card else "kills", rows(outcomes))
        checks = [outcome for outcome in outcomes if "step" in outcome]
        text = with_part(text, "kills of check-rig", rows_of_checks(checks)) if checks else text
    with tempfile.TemporaryDirectory() as folder:
        text = with_part(text, "faults", list(table(Path(folder))))
        text = with_part(text, "faults at the card", list(table(Path(folder), on_card=True)))
    PAGE.write_text(text, encoding="utf-8")


def with_part(text: str, name: str, rows: list[str]) -> str:
    """The page with other rows in the table of this name: those between its heading and its end."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    before, rest = text.split(begin)
    old, after = rest.split(end)
    heading = old.splitlines()[:3]  # an empty line, the heading and its rule
    return before + begin + "\n".join([*heading, *rows, "", end]) + after


def kills_at_the_fake_bench(options: argparse.Namespace, chance: random.Random) -> Iterator[dict[str, Any]]:
    """Window, recorder and loop in turn, each at a random moment."""
    for number in range(options.kills):
        with tempfile.TemporaryDirectory() as folder:
            victim = options.victim or VICTIMS[number % len(VICTIMS)]
            yield asdict(kill_once(Path(folder), victim, chance.uniform(0.05, 2.0)))


def kills_at_the_card(options: argparse.Namespace, chance: random.Random) -> Iterator[dict[str, Any]]:
    """Every process of a recording, then check-rig in each of its steps; each by SIGTERM and by SIGKILL."""
    turns = [(who, how) for how in ("SIGTERM", "SIGKILL") for who in (*VICTIMS, *STEPS)]
    chance.shuffle(turns)
    with tempfile.TemporaryDirectory() as own, served(Path(own) / "output") as card:
        for number in range(options.kills):
            who, how = turns[number % len(turns)]
            with tempfile.TemporaryDirectory() as folder:
                if who in VICTIMS:
                    yield asdict(kill_once(Path(folder), who, chance.uniform(0.05, 2.0), how, card))
                    continue
            for _ in range(TRIES):
                with suppress(NotSoFar):
                    kill = kill_check(card, who, how, chance.random())
                    yield asdict(kill)
                    if not kill.too_late:  # else it is counted as such, and another comes in its place
                        break


def kills_of_a_trial(options: argparse.Namespace, chance: random.Random) -> Iterator[dict[str, Any]]:
    """Every process in every moment of a force trial, by SIGTERM and by SIGKILL."""
    turns = [(who, when, how) for how in ("SIGTERM", "SIGKILL") for when in MOMENTS for who in VICTIMS]
    chance.shuffle(turns)
    with tempfile.TemporaryDirectory() as own:
        model = model_with_effect(Path(own))
        for number in range(options.kills):
            who, when, how = turns[number % len(turns)]
            for _ in range(TRIES):
                with tempfile.TemporaryDirectory() as folder, suppress(NotSoFar):
                    yield asdict(kill_trial(Path(folder), model, who, when, how, chance.random()))
                    break


def rows(outcomes: list[dict[str, Any]]) -> list[str]:
    """Rows of the kills of a recording's processes, with the columns that the page has."""
    told = []
    for victim in VICTIMS:
        mine = [o for o in outcomes if o.get("victim") == victim]
        if not mine:
            continue
        plant, clock = [o["plant_ms"] for o in mine], [o["clock_ms"] for o in mine]
        lost = [o["lost_s"] for o in mine]
        told.append(
            f"| {victim} | {len(mine)} | {sum(o['zero'] for o in mine)} | {sum(o['moving'] for o in mine)} | "
            f"{np.median(plant):.0f} | {max(plant):.0f} | {sum(p > LIMIT_MS for p in plant)} | "
            f"{np.median(clock):.0f} | {max(clock):.0f} | {max(lost):.3f} | "
            f"{sum(s > LIMIT_S for s in lost)} | {sum(o['flushed_lost'] for o in mine)} | "
            f"{sum(o['wrong'] for o in mine)} |"
        )
    return told


def rows_of_checks(kills: list[dict[str, Any]]) -> list[str]:
    """Rows of the kills of ``check-rig``, step by step; ms since the set value of kills that found it."""
    told = []
    for step in STEPS:
        mine = [kill for kill in kills if kill["step"] == step]
        if not mine:
            continue
        plant = [kill["plant_ms"] for kill in mine if kill["driven"]]
        ms = f"{np.median(plant):.0f} | {max(plant):.0f}" if plant else "- | -"
        term, kill9 = (sum(kill["how"] == how for kill in mine) for how in ("SIGTERM", "SIGKILL"))
        since = [kill["since_ms"] for kill in mine if kill["driven"]]
        came = f"{min(since):.0f} to {max(since):.0f}" if since else "-"
        told.append(
            f"| {step} | {term} + {kill9} | {sum(kill['zero'] for kill in mine)} | {len(plant)} | {came} | "
            f"{sum(kill['too_late'] for kill in mine)} | {ms} | "
            f"{sum(p > LIMIT_MS for p in plant)} | {sum(not kill['ended'] for kill in mine)} |"
        )
    return told


if __name__ == "__main__":
    main()
