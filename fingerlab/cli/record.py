"""``fingerlab record``: a session from a device, without the window. Ctrl-C stops the motor first."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import json_option, progress_bar, refuse_existing, write_json
from fingerlab.cli.interrupts import Interrupts
from fingerlab.cli.proposals import TRAJECTORY_HELP, single_plan
from fingerlab.cli.simulate import PROTOCOL_NAMES
from fingerlab.errors import UserError

if TYPE_CHECKING:
    from fingerlab.acquisition.bench import Bench
    from fingerlab.acquisition.commands import Initialise
    from fingerlab.devices.choosing import DeviceChoice
    from fingerlab.rig import Rig


@click.command()
@click.option("--protocol", type=click.Choice(PROTOCOL_NAMES), help="Which runs to take.")
@click.option(
    "--trajectory",
    metavar="FILE|JSON",
    help=TRAJECTORY_HELP,
)
@click.option("--runs", default=1, show_default=True, type=click.IntRange(1, 100), help="Of --trajectory.")
@click.option("--phase", help="Phase of that run: on_air, contact, motor_bench or free.")
@click.option("--cable", type=click.Choice(["extension", "flexion", "none"]), help="Cable of that run.")
@click.option(
    "--device",
    metavar="NAME",
    help="simulated, or a card such as Dev1 or host:31763/Dev1; else the first one found.",
)
@click.option("--rig", "rig_file", type=click.Path(path_type=Path), help="Rig file (TOML).")
@click.option("--title", help="Title of the session.")
@click.option("--operator", help="Who records.")
@click.option("--notes", help="Notes on the session.")
@click.option(
    "--set-position", default=0.0, show_default=True, help="°, the pulley where it stands at first."
)
@click.option("--set-mcp", type=float, help="°, the MCP joint at rest; else as its sensor is calibrated.")
@click.option("--set-pip", type=float, help="°, the PIP joint, in the same way.")
@click.option("--rest", default=2.0, show_default=True, type=click.FloatRange(min=0), help="s between runs.")
@click.option("--force", default=0.8, show_default=True, type=click.FloatRange(min=0.05), help="N, contact.")
@click.option("--yes", is_flag=True, help="Do not wait for a key where the cable is to be changed.")
@click.option("--real-time", is_flag=True, help="Let the simulated rig run in real time, as a card does.")
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Which simulated bench.")
@click.option("--effect", "effects", multiple=True, metavar="ID[=STRENGTH]", help="Of the simulated bench.")
@click.option("--hidden", is_flag=True, help="Hide an effect in the simulated bench until 'reveal'.")
@click.option("--preset", default="practice", help="Of the simulated bench: practice, as-built, or a file.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Session file to write.")
@json_option
def record(out: Path, json_target: str | None, **options: Any) -> None:
    """Record a session from a device.

    What has been recorded is safe at every moment: a recording that was cut is repaired when it is opened.
    The simulated rig runs as fast as it can, unless it is asked for real time.
    """
    from fingerlab.acquisition.protocol import plan_steps
    from fingerlab.devices.choosing import REPLAY

    refuse_existing(out)
    name, plans = _plans(options)
    options["initial"] = _initial(options)
    choice = _choice(options)
    if choice.kind == REPLAY:
        raise UserError("A replay has been recorded already; record from 'simulated' or from a card.")
    steps = plan_steps(plans, options["force"], options["rest"])
    simulated = choice.kind == "simulated"
    bar, report = progress_bar("Recording")
    with bar:
        report(0.0, "opening the device")
        bench, rig, attributes = _open(choice, options, simulated)
        told = {"protocol": name, "device": bench.status().device, **attributes}
        quiet = options["yes"] or simulated  # nobody has to change a cable
        ask = _tell(report) if quiet else _ask(bench, bar)
        try:
            path, samples = _run(bench, steps, out, rig, options, told, ask, report)
        finally:
            bench.close()
    click.echo(f"{len(plans)} runs, {samples} samples, written to {path}.", err=True)
    if json_target is not None:
        write_json(_result(path, name, samples), json_target)


def _run(
    bench: Bench,
    steps: Any,
    out: Path,
    rig: Rig,
    options: Mapping[str, Any],
    told: Mapping[str, Any],
    ask: Callable[[str], None],
    report: Callable[[float, str], None],
) -> tuple[Path, int]:
    from fingerlab.acquisition.protocol import ProtocolDriver
    from fingerlab.acquisition.recording import SessionInfo

    attributes = {k: v for k in ("operator", "notes") if (v := options[k])}
    title = options["title"] or f"{told['protocol']} protocol on {told['device']}"
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    driver = ProtocolDriver(bench, ask, report, options["initial"])
    with Interrupts(bench.stop) as interrupts:
        try:
            bench.recorder.open(SessionInfo(out, rig.to_json(), title, now, {**attributes, **told}))
            driver.take(steps)
        except BaseException as error:
            bench.stop()  # before anything else
            why = KeyboardInterrupt() if interrupts.asked else error
            _keep(bench, why, out)
            raise why from None
    report(1.0, "writing and verifying")
    return bench.recorder.close(), driver.samples


def _initial(options: Mapping[str, Any]) -> Initialise:
    """The values to which encoder and angle sensors are set after each change of the bench."""
    from fingerlab.acquisition.commands import Initialise

    angles: dict[str, float] = {}
    for name in ("position", "mcp", "pip"):
        angle = options[f"set_{name}"]
        if angle is not None and not abs(angle) <= 180.0:
            raise UserError(f"--set-{name} is {angle:g}; it should be an angle from -180 to 180 degrees.")
        if angle is not None:
            angles[name] = math.radians(angle)
    return Initialise(**angles)


def _keep(bench: Bench, error: BaseException, out: Path) -> None:
    """What was recorded before it broke off becomes a session that says so."""
    note = str(error) if isinstance(error, UserError) else "The recording was stopped by the operator."
    try:
        bench.recorder.cut(note)
        path = bench.recorder.close()
    except UserError:
        return
    click.echo(f"The recording broke off; what was taken is in {path}.", err=True)


def _open(
    choice: DeviceChoice, options: Mapping[str, Any], simulated: bool
) -> tuple[Bench, Rig, dict[str, Any]]:
    """The bench, its rig with the calibrations of its folder, and what sessions are to say of both.

    A simulated rig is taken as it is: what it records must depend on its seed alone.
    """
    from platformdirs import user_data_path

    from fingerlab.acquisition.requests import LoopSettings
    from fingerlab.acquisition.safety import Limits
    from fingerlab.acquisition.units import BenchUnits
    from fingerlab.calibration.applying import default_folder, rig_and_attributes

    rescue = user_data_path("FingerLab") / "rescued"
    device = choice.build() if simulated else None
    rig: Rig = device.rig if device is not None else choice.rig  # type: ignore[attr-defined, assignment]
    attributes = dict(getattr(device, "session_attributes", {}))
    if device is None:
        rig, told = rig_and_attributes(rig, default_folder(options["rig_file"]))
        attributes |= told
    settings = LoopSettings(BenchUnits.from_rig(rig), Limits.from_rig(rig))
    if device is not None and not options["real_time"]:
        from fingerlab.acquisition.inline import InlineBench

        return InlineBench(device, settings, rescue), rig, attributes
    from fingerlab.acquisition.process_bench import ProcessBench

    return ProcessBench(choice, settings, rescue, rig.daq.rate_hz), rig, attributes


def _choice(options: Mapping[str, Any]) -> DeviceChoice:
    from fingerlab.devices.choosing import choose_device
    from fingerlab.devices.simulated import Simulation
    from fingerlab.rig_file import load_rig
    from fingerlab.twin.effects import parse_effects

    if options["hidden"] and options["effects"]:
        raise UserError("--hidden picks the effect itself; leave out --effect, or leave out --hidden.")
    rig = load_rig(options["rig_file"]) if options["rig_file"] else None
    simulation = Simulation(
        options["preset"], options["seed"], parse_effects(options["effects"]), options["hidden"]
    )
    return choose_device(options["device"], rig, simulation, real_time=options["real_time"])


def _plans(options: Mapping[str, Any]) -> tuple[str, list[Any]]:
    from fingerlab.twin.preset import load_preset
    from fingerlab.twin.protocols import PROTOCOLS

    protocol, text = options["protocol"], options["trajectory"]
    if (protocol is None) == (text is None):
        raise UserError("Give either --protocol with a name or --trajectory, not both or neither.")
    if protocol is not None:
        if options["phase"] or options["cable"] or options["runs"] > 1:
            raise UserError(f"--phase, --cable and --runs go with --trajectory; {protocol} has its own.")
        amplitude = load_preset(options["preset"]).numbers["protocol"]["contact_amplitude_deg"]
        return protocol, PROTOCOLS[protocol](amplitude)
    return "single", [single_plan(text, options["phase"], options["cable"])] * options["runs"]


def _tell(report: Callable[[float, str], None]) -> Callable[[str], None]:
    return lambda sentence: report(0.0, sentence)


def _ask(bench: Bench, bar: Any) -> Callable[[str], None]:
    """Ask the operator on the terminal while the bench keeps seeing that somebody is there."""
    import threading

    def question(sentence: str) -> None:
        bar.stop()
        click.echo(f"{sentence} Then press Enter.", err=True)
        done = threading.Event()

        def read() -> None:
            sys.stdin.readline()
            done.set()

        threading.Thread(target=read, daemon=True).start()
        while not done.is_set():
            bench.idle()
        bar.start()

    return question


def _result(path: Path, name: str, samples: int) -> dict[str, Any]:
    from fingerlab.sessions import open_session

    session = open_session(path)
    return {
        "session": str(path),
        "protocol": name,
        "runs": len(session.runs),
        "samples": samples,
        "ended": session.attributes.get("ended"),
        "dropped_samples": sum(int(run.attributes.get("dropped_samples", 0)) for run in session.runs),
        "late_cycles": sum(int(run.attributes.get("late_cycles", 0)) for run in session.runs),
    }
