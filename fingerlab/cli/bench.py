"""The commands at a bench: ``devices``, ``check-rig`` and ``calibrate``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.calibration import SENSORS, Calibration, SteadyStep, StepTiming, calibrate_steps, find_steps
from fingerlab.calibration.line import count_steps
from fingerlab.calibration.offline import read_recording
from fingerlab.cli.common import (
    NEW_FILE,
    PATH,
    Interrupts,
    asked_device,
    json_option,
    result_table,
    somebody_there,
    table_console,
    write_json,
)
from fingerlab.core.errors import UserError
from fingerlab.devices import choosing
from fingerlab.devices.choosing import detect
from fingerlab.devices.protocol import FoundDevice
from fingerlab.rig.file import load_rig

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.bench import Bench
    from fingerlab.acquisition.check_rig.look import CheckProtocol, Operator, Outcome
    from fingerlab.acquisition.check_rig.walk import Step
    from fingerlab.devices.choosing import DeviceChoice
    from fingerlab.rig.file import Rig

STATES = {
    "trusted": "confirmed in the window",
    "changed": "changed since it was confirmed: the window asks again",
    "missing": "confirmed, and no longer there",
}


@click.command(short_help="List what can be driven, and forget devices of your own.")
@click.option("--rig", "rig_file", type=PATH, help="Rig file that names the card.")
@click.option(
    "--untrust", metavar="FILE", type=PATH, help="Forget that this device of your own was confirmed."
)
@click.option("--forget", is_flag=True, help="Forget every device of your own.")
@json_option
def devices(rig_file: Path | None, untrust: Path | None, forget: bool, json_target: str | None) -> None:
    """List the card, the simulated rig, and the devices of your own that the window may run.

    The window asks once before it runs the Python file of a device, and remembers the answer; --untrust takes
    it back. In a command, --device own:FILE is the answer itself.
    """
    if forget and untrust is not None:
        raise UserError("--forget forgets every file; leave out --untrust, or leave out --forget.")
    rig = load_rig(rig_file) if rig_file is not None else None
    if untrust is not None:
        choosing.forget(untrust)
        click.echo(f"{untrust} is asked about again before it is run.", err=True)
    if forget:
        choosing.forget_all()
        click.echo("All devices of your own are forgotten.", err=True)
    listed = untrust is None and not forget
    if not listed and json_target is None:
        return
    found, known = detect(rig), choosing.remembered_files()
    if json_target != "-" and listed:
        for one in found:
            click.echo(f"{one.name}  {'can be used' if one.available else 'cannot be used'}: {one.sentence}")
        for path, state in known:
            click.echo(f"own:{path}  {STATES[state]}")
        if not known:
            click.echo("No device of your own was confirmed.")
    if json_target is not None:
        write_json(_to_json(found, known), json_target)


def _to_json(found: tuple[FoundDevice, ...], known: tuple[tuple[Path, str], ...]) -> dict[str, Any]:
    return {
        "schema": 1,
        "devices": [{"name": f.name, "available": f.available, "sentence": f.sentence} for f in found],
        "own_files": [
            {"file": str(path), "state": "confirmed" if state == "trusted" else state}
            for path, state in known
        ],
    }


@click.command("check-rig")
@click.option(
    "--device",
    metavar="NAME",
    help="A card such as Dev1 or host:31763/Dev1; own:FILE.py; 'simulated' for practice; else it is asked.",
)
@click.option("--rig", "rig_file", type=PATH, help="Rig file; the default rig without it.")
@click.option("--out", required=True, type=NEW_FILE, help="Protocol to write (JSON).")
@click.option(
    "--yes", "all_yes", is_flag=True, help="Answer every question with yes: on the simulated rig alone."
)
@click.option(
    "--answer",
    "answers",
    multiple=True,
    metavar="STEP=yes|no|skip",
    help="Answer one step's question, such as limits/force=no; may be repeated. The rest is asked, and every "
    "yes on a bench that is real.",
)
@json_option
def check_rig(
    device: str | None,
    rig_file: Path | None,
    out: Path,
    all_yes: bool,
    answers: tuple[str, ...],
    json_target: str | None,
) -> None:
    """Confirm channels, terminals, signs, limits and assumptions of the rig, step by step.

    Exits with 0 where everything was confirmed. A step that failed or was left out is bad input: the bench is
    not known to be what its rig file says; the exit code is 2 then. The protocol is written either way.
    """
    from fingerlab.acquisition.check_rig.look import write_protocol
    from fingerlab.acquisition.check_rig.walk import check_answers, checks_folder, keep
    from fingerlab.devices.choosing import REPLAY, choose_device, refuse_unknown
    from fingerlab.rig.file import default_rig, load_rig

    given = _answers(answers)
    rig = load_rig(rig_file) if rig_file else default_rig()
    choice = choose_device(device or asked_device(rig, "to check"), rig, real_time=not all_yes)
    refuse_unknown(choice)
    if choice.kind == REPLAY:
        raise UserError("A replay has no bench to check; give a card such as Dev1, or 'simulated'.")
    check_answers(given, all_yes, choice.simulated)
    protocol = checked(choice, _Operator(given, all_yes), str(rig_file or "the default rig"))
    write_protocol(protocol, out)
    if not choice.simulated:  # a rehearsal says nothing about a real bench
        keep(protocol, checks_folder(rig_file))
    states = [outcome.state for outcome in protocol.outcomes]
    counted = ", ".join(f"{states.count(state)} {state}" for state in dict.fromkeys(states))
    click.echo(f"{counted}. Written to {out}.", err=True)
    if json_target is not None:
        write_json(_json(protocol), json_target)
    if not protocol.all_confirmed:
        raise UserError(_complaint(protocol, out))


def checked(
    choice: DeviceChoice, operator: Operator, rig_source: str, steps: Sequence[Step] | None = None
) -> CheckProtocol:
    """Open the bench, walk through all steps or those given, and close it whatever happens.

    Raises:
        UserError: the bench cannot be opened, or nobody answers. KeyboardInterrupt: it was stopped.
    """
    from fingerlab.acquisition.check_rig.walk import STEPS, bench_key
    from fingerlab.acquisition.check_rig.walk import check_rig as check
    from fingerlab.devices.choosing import CARD
    from fingerlab.rig.file import default_rig

    rig = choice.rig or default_rig()
    with ExitStack() as stack:
        opening = stack.enter_context(Interrupts(lambda: None))  # who is asked to end gives back what it has
        bench = _open(choice, rig)
        stack.callback(bench.close)
        opening.check()
        operator.tell(f"Checking {bench.status().device}.")
        with Interrupts(bench.stop) as interrupts:
            walked = STEPS if steps is None else steps
            on_card = choice.kind == CARD
            protocol = check(bench, rig, operator, rig_source, on_card, walked, bench_key(choice))
        interrupts.check()
    return protocol


def _open(choice: DeviceChoice, rig: Rig) -> Bench:
    """The bench with its loop, limits and guardian; a rehearsal without questions waits for no clock."""
    from fingerlab.acquisition.check_rig.look import check_settings
    from fingerlab.acquisition.recording import rescue_folder

    settings = check_settings(rig)
    if choice.simulated and not choice.real_time:
        from fingerlab.acquisition.bench.process_bench import InlineBench

        return InlineBench(choice.build(), settings, rescue_folder())
    from fingerlab.acquisition.bench.process_bench import ProcessBench

    return ProcessBench(choice, settings, rescue_folder(), rig.daq.rate_hz)


def _complaint(protocol: Any, out: Path) -> str:
    """Which steps failed or were left out, and what to do."""
    from fingerlab.acquisition.check_rig.look import FAILED, SKIPPED

    said = []
    for state, words in ((FAILED, "failed"), (SKIPPED, "were left out")):
        steps = [outcome.id for outcome in protocol.outcomes if outcome.state == state]
        if steps:
            said.append(f"{', '.join(steps)} {words}")
    return (
        f"The rig is not confirmed ({'; '.join(said)}; see {out}); correct the wiring or the rig file and "
        "run check-rig again."
    )


class _Operator:
    """Asks on the terminal, unless the command line has answered already."""

    def __init__(self, answers: dict[str, str], all_yes: bool) -> None:
        self._answers, self._all_yes = answers, all_yes

    def tell(self, text: str) -> None:
        click.echo(text, err=True)

    def found(self, outcome: Outcome) -> None:
        self.tell(f"{outcome.state}: {outcome.title.rstrip('.')}. {outcome.sentence}")

    def ask(self, step: str, question: str) -> str:
        if step in self._answers or self._all_yes:
            answer = self._answers.get(step, "yes")
            click.echo(f"[{step}] {question} {answer}", err=True)
            return answer
        if not somebody_there():
            raise UserError(f"Nobody is there to answer the step '{step}'; run check-rig in a terminal.")
        words = click.Choice(["yes", "no", "skip"])
        answer = click.prompt(f"[{step}] {question}", type=words, err=True)
        return str(answer)


def _answers(given: tuple[str, ...]) -> dict[str, str]:
    result = {}
    for text in given:
        step, _, answer = text.partition("=")
        if answer not in ("yes", "no", "skip"):
            raise UserError(f"--answer {text!r} should look like limits/force=no, with yes, no or skip.")
        result[step] = answer
    return result


def _json(protocol: Any) -> dict[str, Any]:
    from fingerlab.acquisition.check_rig.look import finite

    result: dict[str, Any] = finite(protocol.to_json())
    return result


@click.command()
@click.argument("data", metavar="DATA [DATA2 ...]", nargs=-1, required=True, type=PATH)
@click.option("--sensor", "word", required=True, type=click.Choice(tuple(SENSORS)), help="Which sensor.")
@click.option(
    "--marks",
    metavar="M1,M2,...",
    help="Known value of each step: kg for the load cell, degrees for an angle sensor.",
)
@click.option("--column", help="Column of the volts: a number, a header, or a raw channel of a session.")
@click.option("--run", "run_name", metavar="NAME", help="Run of a session.  [default: the first with volts]")
@click.option("--step", "step_seconds", type=float, default=15.0, show_default=True, help="Seconds a step.")
@click.option(
    "--centre",
    "centre_seconds",
    type=float,
    default=5.0,
    show_default=True,
    help="Seconds in the middle of each step that count.",
)
@json_option
def calibrate(
    data: tuple[Path, ...],
    word: str,
    marks: str | None,
    column: str | None,
    run_name: str | None,
    step_seconds: float,
    centre_seconds: float,
    json_target: str | None,
) -> None:
    """Fit a sensor's straight line from a stepped recording, and compare it with the data sheet.

    DATA is a text file with time (s) in its first column and volts in another, at 20 Hz as the bench
    records them, or a session that holds the volts as read in /runs/NNN/raw. Each step lasts 15 s, of
    which the central 5 s count. A repeated recording may be given as a second file; all steps then share
    one line.

    The load cell is loaded with 0 to 1 kg in steps of 100 g (F = m g, g = 9.81 m/s2); an angle sensor
    is held at --marks, without them evenly from 0 to 90 degrees.
    """
    sensor, timing = SENSORS[word], StepTiming(step_seconds, centre_seconds)
    steps: list[SteadyStep] = []
    values: list[float] = []
    notes: list[str] = []
    for path in data:
        recording = read_recording(path, sensor, column, run_name)
        available = count_steps(recording.time, timing)
        known = _marks(marks) or sensor.default_marks(available)
        steps += find_steps(recording.time, recording.volts, len(known), timing)
        values += known
        notes.append(f"{recording.source}: {len(known)} steps")
        if available > len(known):
            notes.append(
                f"{available - len(known)} steps more at its end have no known value and are left out"
            )
    result = calibrate_steps(sensor, steps, values)
    if marks is None and sensor.mark_unit == "deg":
        notes.append("marks assumed evenly from 0° to 90° (--marks)")
    if json_target != "-":
        _print_calibration(result, values, notes)
    if json_target is not None:
        write_json(
            {**result.to_json(), "recordings": [str(path) for path in data], "notes": notes}, json_target
        )


def _marks(text: str | None) -> tuple[float, ...]:
    if text is None:
        return ()
    try:
        marks = tuple(float(part) for part in text.split(","))
    except ValueError:
        marks = (math.nan,)
    if not all(math.isfinite(mark) for mark in marks):
        raise UserError(f"--marks {text!r} is no list of numbers; write it like 0,15,30,45,60,75,90.")
    return marks


def _print_calibration(result: Calibration, marks: list[float], notes: list[str]) -> None:
    sensor = result.sensor
    scale, unit = sensor.screen.factor, sensor.screen.symbol
    console = table_console(width=110)
    console.print(sensor.title, style="bold")
    for note in notes:
        console.print(note)
    table = result_table(
        *(f">known ({sensor.mark_unit})", f">known ({unit})", ">reading (V)", ">spread (V)"), f">off ({unit})"
    )
    for mark, known, step, off in zip(marks, result.known, result.steps, result.residuals, strict=True):
        cells = (f"{mark:g}", f"{known * scale:.3f}", f"{step.volts:.4f}", f"{step.spread:.4f}")
        table.add_row(*cells, f"{off * scale:+.3f}")
    console.print(table)
    for name, value, per in (("gain", result.gain, "/V"), ("offset", result.offset, "")):
        low, high = value.low * scale, value.high * scale
        console.print(
            f"{name:7} {value.value * scale:.4f} {unit}{per}  (90 % interval {low:.4f} to {high:.4f})"
        )
    console.print(
        f"R²      {result.r2:.5f}; rms {result.rms * scale:.3g} {unit}; zero at {result.zero_volts:.4f} V"
    )
    limit = sensor.gain
    console.print(f"sheet   {limit.low * scale:.1f} to {limit.high * scale:.1f} {unit}/V ({limit.source})")
    if sensor.published:
        gain, offset = sensor.published
        console.print(f"thesis  {gain:g} {unit}/V, {offset:g} {unit}")
    for sentence in result.suspect or ("Nothing speaks against it.",):
        console.print(f"suspect: {sentence}" if result.suspect else sentence)
