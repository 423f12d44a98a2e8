"""``fingerlab record``: a session from a device, without the window. Ctrl-C stops the motor first."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import (
    NEW_SESSION,
    PATH,
    Interrupts,
    Within,
    asked_device,
    counted,
    json_option,
    progress_bar,
    write_json,
)
from fingerlab.cli.record_session import Events
from fingerlab.cli.simulate import PROTOCOL_HELP, TRAJECTORY_HELP, ProtocolName, protocol_plans, single_plan
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.sessions.model import CABLES

if TYPE_CHECKING:
    from fingerlab.acquisition.bench.bench import Bench
    from fingerlab.acquisition.control.machine import Initialise
    from fingerlab.acquisition.control.motion import Gains
    from fingerlab.acquisition.protocols.driver import Beginning
    from fingerlab.acquisition.protocols.script import Order
    from fingerlab.acquisition.protocols.steps import Step
    from fingerlab.devices.choosing import DeviceChoice
    from fingerlab.models.file import SavedModel
    from fingerlab.rig.file import Rig

FORCE = Within(min=0.05, max=50.0)
"""N: a fingertip presses with up to 20."""


@click.command()
@click.option("--protocol", type=ProtocolName(), help=PROTOCOL_HELP)
@click.option(
    "--from-run",
    default=1,
    show_default=True,
    type=click.IntRange(min=1),
    help="Begin with this run of the protocol, such as the one in which it was stopped.",
)
@click.option(
    "--gains",
    metavar="P,I,D",
    help="Of the position loop, A/rad, A/(rad s), A s/rad; else the usual ones. Written with each run.",
)
@click.option("--trajectory", metavar="FILE|JSON", help=TRAJECTORY_HELP)
@click.option("--runs", default=1, show_default=True, type=click.IntRange(1, 100), help="Of --trajectory.")
@click.option("--phase", help="Phase of that run: on_air, contact, motor_bench or free.")
@click.option("--cable", type=click.Choice(CABLES), help="Cable of that run.")
@click.option(
    "--device",
    metavar="NAME",
    help="simulated; a card such as Dev1 or host:31763/Dev1; own:FILE.py; else it is asked.",
)
@click.option("--rig", "rig_file", type=PATH, help="Rig file (TOML).")
@click.option("--title", help="Title of the session.")
@click.option("--operator", help="Who records.")
@click.option("--notes", help="Notes on the session.")
@click.option(
    "--set-position", type=float, help="°, the pulley where it stands at first; else as the rig file, or 0."
)
@click.option("--set-mcp", type=float, help="°, the MCP joint at rest; else as rig file or calibration say.")
@click.option("--set-pip", type=float, help="°, the PIP joint, in the same way.")
@click.option("--rest", default=2.0, show_default=True, type=Within(min=0, max=3600), help="s between runs.")
@click.option("--force", default=0.8, show_default=True, type=FORCE, help="N, contact.")
@click.option(
    "--then-contact",
    type=Within(min=0.0, max=90.0),
    help="°, after --trajectory on air as many runs in contact, with this amplitude about the found contact.",
)
@click.option(
    "--pre-trigger",
    default=0.0,
    show_default=True,
    type=Within(min=0.0, max=25.0),
    help="s that each run begins earlier than its motion, or than its trigger.",
)
@click.option(
    "--trigger",
    metavar="LEVEL",
    help="Begin each run where its motion crosses a level, such as 'endpoint_force>0.5', "
    "'motor_position<-10deg' or 'motor_speed>90deg/s'; in N, A, N m, rad and rad/s where it says no deg.",
)
@click.option(
    "--commands",
    metavar="FILE",
    help="Lines to obey meanwhile, '-' for standard input: 'mark NOTE', 'pause', 'resume', 'end', 'stop', "
    "'ready' (the bench is changed as asked); each maybe after a moment of a run, '@SECONDS' or "
    "'@RUN:SECONDS'.",
)
@click.option("--events", metavar="FILE", help="Tell what happens as JSON lines; '-' for standard output.")
@click.option(
    "--compare",
    metavar="nominal|MODEL.json",
    help="Tell among --events by how much this model misses torque (N m) and force (N).",
)
@click.option(
    "--feed-forward",
    "feed_model",
    metavar="M.json",
    type=PATH,
    help="In place of a protocol: send the torque that --wanted needs by this model ('diagnose --save').",
)
@click.option(
    "--wanted",
    metavar="FILE|JSON",
    help="Endpoint force for --feed-forward: a table of time (s) and force (N), or JSON as for 'inverse'.",
)
@click.option(
    "--ab",
    "pairs",
    default=0,
    type=click.IntRange(0, 50),
    metavar="N",
    help="Nominal against found model, N runs each in pairs, in random order (drawn by --seed).",
)
@click.option(
    "--variant",
    default="found",
    show_default=True,
    type=click.Choice(["found", "nominal"]),
    help="Model that is sent without --ab, --runs times.",
)
@click.option(
    "--most-correction",
    default=0.5,
    show_default=True,
    type=Within(min=0.01, max=1.0),
    help="Share of the rig's limit of torque by which the found torque may leave the nominal one.",
)
@click.option("--yes", is_flag=True, help="Ask nobody about cable and bench: on the simulated rig alone.")
@click.option("--real-time", is_flag=True, help="Let the simulated rig run in real time, as a card does.")
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Which simulated bench.")
@click.option("--effect", "effects", multiple=True, metavar="ID[=STRENGTH]", help="Of the simulated bench.")
@click.option("--hidden", is_flag=True, help="Hide an effect in the simulated bench until 'reveal'.")
@click.option("--preset", default="practice", help="Of the simulated bench: practice, as-built, or a file.")
@click.option("--out", required=True, type=NEW_SESSION, help="Session file to write (.h5).")
@json_option
def record(out: Path, json_target: str | None, **options: Any) -> None:
    """Record a session from a device.

    What has been recorded is safe at every moment: a recording that was cut is repaired when it is opened.
    The simulated rig runs as fast as it can, unless it is asked for real time.
    """
    from fingerlab.acquisition.recording import refuse_beyond
    from fingerlab.cli.record_session import SessionOptions, take
    from fingerlab.devices.choosing import REPLAY

    files = [
        Path(place).resolve() for place in (out, json_target, options["events"]) if place not in (None, "-")
    ]
    if len(set(files)) < len(files):
        raise UserError("--out, --json and --events name the same file; give each its own.")
    if json_target == options["events"] == "-":
        raise UserError("--json and --events cannot both have standard output; give one of them a file.")
    choice = _choice(options) if options["device"] else None  # what is wrong with it comes first
    name, steps = ("feed-forward", None) if _feeds(options) else _planned(options)
    angles, beginning = _angles(options), _beginning(options)
    orders, model = _orders(options["commands"]), _model(options["compare"])
    choice = choice or _choice(options)
    if choice.kind == REPLAY:
        raise UserError("A replay has been recorded already; record from 'simulated' or from a card.")
    simulated = choice.kind == "simulated"
    if not simulated and (options["effects"] or options["hidden"]):  # a real motor is not what was meant
        raise UserError(
            "--effect and --hidden are of the simulated rig; leave them out, or give --device simulated."
        )
    if not simulated and options["yes"]:  # nobody would have looked which cable is on the pulley
        raise UserError(
            "--yes is for the simulated rig; at a real bench answer each question about the cable in a "
            "terminal, or by a line 'ready' of --commands."
        )
    with ExitStack() as stack:
        events = stack.enter_context(Events(options["events"]))
        bar, report = progress_bar("Recording")
        stack.enter_context(bar)
        report(0.0, "opening the device")
        # Who is asked to end gives back what it has opened.
        interrupts = stack.enter_context(Interrupts(lambda: None))
        bench, rig, attributes = _open(choice, options, simulated)
        stack.callback(bench.close)
        interrupts.check()
        if beginning.trigger is not None:
            refuse_beyond(beginning.trigger, rig.limits)
        attributes |= {k: v for k in ("operator", "notes") if (v := options[k])}
        if steps is None:
            steps, more = _trial_steps(options, rig)
            attributes |= more
        session_options = SessionOptions(
            out=out,
            name=name,
            title=options["title"],
            attributes=attributes,
            initial=_initial(rig, angles),
            beginning=beginning,
            model=model,
            orders=orders,
            typed=options["commands"] == "-",
            asks=not simulated,  # where nobody has to change a cable
        )
        path, samples, runs = take(bench, rig, steps, session_options, events, bar, report)
        result = _result(path, name, samples)
        events.tell("written", result)
    click.echo(f"{counted(runs, 'run')}, {samples} samples, written to {path}.", err=True)
    if json_target is not None:
        write_json(result, json_target)


def _feeds(options: Mapping[str, Any]) -> bool:
    """Whether a feed-forward is asked for.

    Raises:
        UserError: it is, and something that does not go with it.
    """
    if options["feed_model"] is None:
        if options["wanted"] or options["pairs"]:
            raise UserError("--wanted and --ab go with --feed-forward; name the model's file there.")
        return False
    others = ("protocol", "trajectory", "phase", "cable", "then_contact", "trigger")
    named = [f"--{name.replace('_', '-')}" for name in others if options[name] is not None]
    named += ["--from-run"] * (options["from_run"] > 1) + ["--pre-trigger"] * (options["pre_trigger"] > 0)
    if named:
        raise UserError(f"--feed-forward has runs of its own; leave out {', '.join(named)}.")
    if not options["wanted"]:
        raise UserError("--wanted is missing; give the endpoint force that --feed-forward is to make.")
    if options["pairs"] and options["runs"] > 1:
        raise UserError("--ab says how many runs there are of each model; leave out --runs.")
    return True


def _planned(options: Mapping[str, Any]) -> tuple[str, tuple[Step, ...] | None]:
    """Name and steps of a protocol or of single runs."""
    from fingerlab.acquisition.protocols.steps import plan_steps, steps_from

    name, plans = _plans(options)
    return name, steps_from(plan_steps(plans, options["force"], options["rest"]), options["from_run"])


def _trial_steps(options: Mapping[str, Any], rig: Rig) -> tuple[tuple[Step, ...], dict[str, Any]]:
    """Steps of a feed-forward, and what the session is to say of it."""
    from fingerlab.acquisition.protocols.force_trial import ForceTrial, TrialSettings
    from fingerlab.twin.bench import preset_of

    amplitude = preset_of(options["preset"]).numbers["protocol"]["contact_amplitude_deg"]
    trial = ForceTrial(
        TrialSettings(
            options["feed_model"], options["wanted"], options["pairs"], options["runs"], options["variant"],
            options["seed"], options["force"], amplitude, options["rest"], options["most_correction"],
        ),
        rig,
    )  # fmt: skip
    return trial.steps(), trial.attributes


def _angles(options: Mapping[str, Any]) -> dict[str, float]:
    """The values that were given for encoder and angle sensors, rad."""
    angles: dict[str, float] = {}
    for name in ("position", "mcp", "pip"):
        angle = options[f"set_{name}"]
        if angle is not None and not abs(angle) <= 180.0:
            raise UserError(f"--set-{name} is {angle:g}; it should be an angle from -180 to 180 degrees.")
        if angle is not None:
            angles[name] = math.radians(angle)
    return angles


def _initial(rig: Rig, angles: Mapping[str, float]) -> Initialise:
    """What the sensors are set to after each change of the bench: as given, else as the rig predefines it."""
    from fingerlab.acquisition.control.machine import initial_of

    return replace(initial_of(rig), **angles)


def _beginning(options: Mapping[str, Any]) -> Beginning:
    from fingerlab.acquisition.protocols.driver import Beginning
    from fingerlab.acquisition.recording import read_level

    level = options["trigger"]
    return Beginning(options["pre_trigger"], None if level is None else read_level(level))


def _orders(source: str | None) -> list[Order]:
    """What a file asks for; standard input is read while it is recorded."""
    from fingerlab.acquisition.protocols.script import read_orders

    if source is None or source == "-":
        return []
    text = read_text(Path(source), "--commands a text file, or '-'")
    return read_orders(text.splitlines(), source)


def _model(source: str | None) -> SavedModel | str | None:
    if source is None or source == "nominal":
        return source
    from fingerlab.models.file import load_model

    return load_model(Path(source))


def _open(
    choice: DeviceChoice, options: Mapping[str, Any], simulated: bool
) -> tuple[Bench, Rig, dict[str, Any]]:
    """The bench, its rig with the calibrations of its folder, and what sessions are to say of both.

    A simulated rig is taken as it is: what it records must depend on its seed alone.
    """
    from fingerlab.acquisition.bench.steering import LoopSettings
    from fingerlab.acquisition.check_rig.walk import bench_key, checks_folder, last_check
    from fingerlab.acquisition.control.units import BenchUnits
    from fingerlab.acquisition.recording import rescue_folder
    from fingerlab.calibration.store import default_folder, rig_and_attributes
    from fingerlab.devices.protocol import SelfDescribing

    device = choice.build() if simulated else None
    rig: Rig = device.rig if device is not None else choice.rig  # type: ignore[attr-defined, assignment]
    attributes: dict[str, Any] = dict(device.session_attributes) if isinstance(device, SelfDescribing) else {}
    if device is None:
        rig, calibrations = rig_and_attributes(rig, default_folder(options["rig_file"]))
        attributes |= calibrations
    settings = LoopSettings(BenchUnits.from_rig(rig), rig.limits, _gains(options["gains"]))
    if device is None:
        check = last_check(rig, bench_key(choice), checks_folder(options["rig_file"]))
        settings = replace(settings, current_share=check.current_share())
        attributes["check_rig"] = check.words
        click.echo(f"{check.sentence(rig)}", err=True)
    if device is not None and not options["real_time"]:
        from fingerlab.acquisition.bench.process_bench import InlineBench

        return InlineBench(device, settings, rescue_folder()), rig, attributes
    from fingerlab.acquisition.bench.process_bench import ProcessBench

    return ProcessBench(choice, settings, rescue_folder(), rig.daq.rate_hz), rig, attributes


def _gains(text: str | None) -> Gains:
    """Raises UserError where they are no three numbers within what the loop takes."""
    from fingerlab.acquisition.control.motion import Gains, check_gains

    if text is None:
        return Gains()
    try:
        proportional, integral, derivative = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"--gains is {text!r}; it should be three numbers, such as 14,25,0.25.") from None
    gains = Gains(proportional, integral, derivative)
    check_gains(gains)
    return gains


def _choice(options: Mapping[str, Any]) -> DeviceChoice:
    from fingerlab.devices.choosing import choose_device, refuse_unknown
    from fingerlab.devices.simulated import Simulation
    from fingerlab.rig.file import load_rig
    from fingerlab.twin.effects import parse_effects

    if options["hidden"] and options["effects"]:
        raise UserError("--hidden picks the effect itself; leave out --effect, or leave out --hidden.")
    rig = load_rig(options["rig_file"]) if options["rig_file"] else None
    simulation = Simulation(
        options["preset"], options["seed"], parse_effects(options["effects"]), options["hidden"]
    )
    name = options["device"] or asked_device(rig, "to record from")
    choice = choose_device(name, rig, simulation, real_time=options["real_time"])
    refuse_unknown(choice)
    return choice


def _plans(options: Mapping[str, Any]) -> tuple[str, list[Any]]:
    from fingerlab.acquisition.protocols.steps import in_contact
    from fingerlab.twin.protocols import load_preset

    protocol, text, press = options["protocol"], options["trajectory"], options["then_contact"]
    if (protocol is None) == (text is None):
        raise UserError("Give either --protocol with a name or --trajectory, not both or neither.")
    if protocol is not None:
        if options["phase"] or options["cable"] or options["runs"] > 1 or press is not None:
            raise UserError(
                f"--phase, --cable, --runs and --then-contact go with --trajectory; {protocol} has its own."
            )
        amplitude = load_preset(options["preset"]).numbers["protocol"]["contact_amplitude_deg"]
        return protocol_plans(protocol, amplitude)
    plan = single_plan(text, options["phase"], options["cable"])
    plans = [plan] * options["runs"]
    if press is None:
        return "single", plans
    if plan.phase != "on_air":
        raise UserError("--then-contact follows runs on air; give --phase on_air, or leave it out.")
    return "on air, then contact", [*plans, *[in_contact(plan, press)] * options["runs"]]


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
