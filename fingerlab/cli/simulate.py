"""``simulate``, ``reveal`` and ``replicate``: sessions of the simulated rig, the thesis repeated on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table

from fingerlab.cli.common import (
    NEW_SESSION,
    PATH,
    counted,
    json_option,
    progress_bar,
    refuse_same_place,
    table_console,
    write_json,
)
from fingerlab.core.errors import UserError
from fingerlab.core.files import read_text
from fingerlab.core.plain_data import read_object
from fingerlab.core.progress import Watch
from fingerlab.report.comparison_words import (
    ComparedQuantity,
    cells,
    lines_json,
    outcome_sentences,
    replicated,
)
from fingerlab.sessions.model import CABLES

if TYPE_CHECKING:
    from fingerlab.rig.file import Rig
    from fingerlab.twin.protocols import RunPlan

PROTOCOL_NAMES = ("on-air", "contact", "motor-bench", "thesis", "rich")
TABLES = (".csv", ".txt", ".tsv")
PROTOCOL_HELP = "Which runs to take: a protocol by its name, or a text table with a row for each kind of run."


class ProtocolName(click.Choice):
    """One of the protocols, or the file of a table of runs."""

    def __init__(self) -> None:
        super().__init__(PROTOCOL_NAMES)

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        return f"[{'|'.join(PROTOCOL_NAMES)}|TABLE.csv]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if str(value).lower().endswith(TABLES):
            return str(value)
        if value not in PROTOCOL_NAMES:
            raise UserError(
                f"--protocol is {str(value)!r}; it should be one of {', '.join(PROTOCOL_NAMES)}, or a table "
                "such as TABLE.csv."
            )
        return super().convert(value, param, ctx)


def protocol_plans(protocol: str, contact_amplitude_deg: float) -> tuple[str, list[RunPlan]]:
    """A protocol's name for the session, and its runs.

    Raises:
        UserError: it is a table that cannot be read.
    """
    from fingerlab.twin.protocols import PROTOCOLS, read_run_table

    if protocol in PROTOCOLS:
        return protocol, PROTOCOLS[protocol](contact_amplitude_deg)
    return Path(protocol).stem, read_run_table(Path(protocol))


TRAJECTORY_HELP = (
    "Take one run with this trajectory instead of a protocol: JSON text, a file of it, or what 'inverse' or "
    "'diagnose --json' gave."
)


def single_plan(source: str, phase: str | None, cable: str | None) -> RunPlan:
    """The one run that was asked for; ``phase`` and ``cable`` given by hand come before the proposal's.

    Args:
        source: a trajectory, a proposal (``next_experiment``) or a whole diagnosis, as JSON text or as the
            name of a file of it.

    Raises:
        UserError: it is none of them, proposes nothing, or cannot be run; or the phase is missing.
    """
    from fingerlab.twin.protocols import single_run

    found = read_proposal(source)
    phase = phase or found.get("phase")
    if phase is None:
        raise UserError("--trajectory needs --phase: on_air, contact, motor_bench or free.")
    return single_run(found["trajectory"], phase, cable or found.get("cable"), found.get("intervention"))


def read_proposal(text: str) -> dict[str, Any]:
    """A trajectory, a proposal, or a whole diagnosis; the answer holds 'trajectory', maybe phase and cable.

    Raises:
        UserError: it is none of them.
    """
    where = "--trajectory"
    if not text.lstrip().startswith("{"):
        where = text
        text = read_text(Path(text), "--trajectory JSON text or a file of it")
    data = read_object(text, where, "give a trajectory or what diagnose wrote")
    if "next_experiment" in data:
        data = data["next_experiment"]
        if data is None:
            raise UserError(f"{where} proposes no experiment: its diagnosis has nothing left to separate.")
    if not isinstance(data, dict):
        raise UserError(f"{where} is not a JSON object; it should hold 'trajectory', or 'kind' and the like.")
    return data if "trajectory" in data else {"trajectory": data}


@click.command()
@click.option("--protocol", type=ProtocolName(), help=PROTOCOL_HELP)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="ID[=STRENGTH]",
    help="Put an effect of the catalogue into the bench; may be repeated. STRENGTH is a number in the SI "
    "unit of the effect's first parameter, or like x0.5 for half of its default.",
)
@click.option(
    "--hidden",
    is_flag=True,
    help="Pick one effect (none in 15 % of cases), 0.6 to 1.6 times its default, and seal it until 'reveal'.",
)
@click.option(
    "--practice",
    is_flag=True,
    help="As --hidden, but always an effect, and one that the rich and the thesis' protocol show well.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), help="Same seed, same bench, same noise. Random by default."
)
@click.option("--preset", default="practice", show_default=True, help="practice, as-built, or a TOML file.")
@click.option(
    "--model",
    "model_file",
    metavar="M.json",
    type=PATH,
    help="A twin of the bench that a saved model describes; the preset tells what the model does not. Values "
    "are drawn from their uncertainty by the seed.",
)
@click.option("--best-values", is_flag=True, help="With --model: take its best values, draw none.")
@click.option("--trajectory", metavar="FILE|JSON", help=TRAJECTORY_HELP)
@click.option("--phase", help="Phase of that run: on_air, contact, motor_bench or free.")
@click.option("--cable", type=click.Choice(CABLES), help="Cable of that run.")
@click.option("--out", required=True, type=NEW_SESSION, help="Session file to write (.h5).")
@json_option
def simulate(
    protocol: str | None,
    effects: tuple[str, ...],
    hidden: bool,
    practice: bool,
    seed: int | None,
    preset: str,
    model_file: Path | None,
    best_values: bool,
    trajectory: str | None,
    phase: str | None,
    cable: str | None,
    out: Path,
    json_target: str | None,
) -> None:
    """Record a session from the simulated rig.

    The protocols: 'thesis' is ten runs of 30 s on air with the extension cable and ten in contact with the
    flexion cable; 'rich' adds chirps, multisines, steps and free motion with the flexion cable; 'on-air' and
    'contact' are its two parts; 'motor-bench' is the motor alone against known loads.
    """
    from fingerlab.twin.bench import learned
    from fingerlab.twin.effects import parse_effects
    from fingerlab.twin.protocols import load_preset
    from fingerlab.twin.session import new_seed, write_session

    refuse_same_place({"--out": out, "--json": json_target})
    if hidden and practice:
        raise UserError("--hidden and --practice both pick the effect; give one of them.")
    if (hidden or practice) and effects:
        flag = "--hidden" if hidden else "--practice"
        raise UserError(f"{flag} picks the effect itself; leave out --effect, or leave out {flag}.")
    if best_values and model_file is None:
        raise UserError("--best-values goes with --model, which names the model whose values are meant.")
    chosen = parse_effects(effects)
    bench, seed = load_preset(preset), new_seed() if seed is None else seed
    if model_file is not None:
        twin = learned(model_file, bench, seed, best_values)
        bench, chosen = twin.preset, _beside(twin.effects, chosen, model_file)
    name, plans = _plans(
        protocol, trajectory, phase, cable, bench.numbers["protocol"]["contact_amplitude_deg"]
    )
    _refuse_beyond(plans, bench.rig)
    bar, report = progress_bar("Simulating")
    with bar:
        report(0.0, "compiling")
        written = write_session(out, bench, name, plans, chosen, seed, hidden, report, practice)
    click.echo(f"{counted(written.runs, 'run')}, {written.seconds:g} s, written to {out}.", err=True)
    if json_target is not None:
        write_json(written.to_json(), json_target)


def _refuse_beyond(plans: Sequence[RunPlan], rig: Rig) -> None:
    """Refuse runs that the rig's limits do not allow, as a recording of them is.

    Raises:
        UserError: one goes beyond.
    """
    from fingerlab.acquisition.bench.steering import LoopSettings
    from fingerlab.acquisition.control.units import BenchUnits
    from fingerlab.acquisition.protocols.driver import refuse_impossible
    from fingerlab.acquisition.protocols.steps import plan_steps

    steps = plan_steps(plans, min(FORCE_N, rig.limits.force), 0.0)
    refuse_impossible(steps, LoopSettings(BenchUnits.from_rig(rig), rig.limits))


FORCE_N = 0.8
"""What a contact is found with where nobody says: of no consequence for a bench that is simulated."""


def _beside(
    found: Mapping[str, Mapping[str, float]], chosen: Mapping[str, Mapping[str, float]], model: Path
) -> dict[str, dict[str, float]]:
    """The effects of a model and those that are put in beside them.

    Raises:
        UserError: one is both.
    """
    for name in chosen:
        if name in found:
            raise UserError(f"The effect {name!r} is in {model} already; leave out --effect {name}.")
    return {name: dict(values) for name, values in (*found.items(), *chosen.items())}


@click.command()
@click.argument("session", type=PATH)
@json_option
def reveal(session: Path, json_target: str | None) -> None:
    """Tell which effects a simulated SESSION has."""
    from fingerlab.twin.effects import EFFECTS
    from fingerlab.twin.session import reveal_session

    revealed = reveal_session(session)
    if json_target is not None:
        write_json({"session": str(session), **revealed}, json_target)
    if json_target == "-":
        return
    if not revealed["effects"]:
        click.echo("No effect: nothing is missing from the nominal model but noise and tolerances.")
    for name, values in revealed["effects"].items():
        units = {p.name: p.unit for p in EFFECTS[name].parameters} if name in EFFECTS else {}
        numbers = ", ".join(f"{k} = {v:.4g} {units.get(k, '')}".rstrip() for k, v in values.items())
        click.echo(f"{name}: {numbers}")


def _plans(
    protocol: str | None, trajectory: str | None, phase: str | None, cable: str | None, amplitude: float
) -> tuple[str, list[RunPlan]]:
    if (protocol is None) == (trajectory is None):
        raise UserError(
            "Give either --protocol with a name or --trajectory with JSON text, not both or neither."
        )
    if protocol is not None:
        if phase or cable:
            raise UserError(f"--phase and --cable go with --trajectory; the protocol {protocol} has its own.")
        return protocol_plans(protocol, amplitude)
    return "single", [single_plan(str(trajectory), phase, cable)]


@click.command()
@click.option("--preset", default="as-built", show_default=True, help="as-built, practice, or a TOML file.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Bench and noise.")
@click.option(
    "--benches",
    type=click.IntRange(min=1, max=100),
    default=1,
    show_default=True,
    help="How many benches to draw within the tolerances, with this seed and the following ones.",
)
@json_option
def replicate(preset: str, seed: int, benches: int, json_target: str | None) -> None:
    """The thesis' experiment end to end on the simulated rig, beside the published numbers."""
    seeds = list(range(seed, seed + benches))
    bar, report = progress_bar("Replicating")
    with bar:
        lines = replicated(preset, seeds, Watch(report))
    if json_target is not None:
        write_json({"preset": preset, "seeds": seeds, **lines_json(lines)}, json_target)
    if json_target != "-":
        console = table_console()
        console.print(_table(lines))
        for sentence in outcome_sentences(lines):
            console.print(sentence, soft_wrap=True)


def _table(lines: Sequence[ComparedQuantity]) -> Table:
    table = Table(title="The thesis' experiment on the simulated rig", title_justify="left")
    table.add_column("quantity")
    for title in ("published", "ours"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("")
    table.add_column("unit")
    for line in lines:
        table.add_row(*cells(line))
    return table
