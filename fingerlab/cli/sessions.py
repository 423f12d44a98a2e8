"""``info``, ``import`` and ``export``: session files from the command line."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.table import Table

from fingerlab.cli.common import (
    NEW_FILE,
    PATH,
    Within,
    counted,
    json_option,
    progress_bar,
    result_table,
    session_argument,
    somebody_there,
    table_console,
    write_json,
)
from fingerlab.core.errors import UserError
from fingerlab.core.plain_data import read_object
from fingerlab.rig.file import (
    GIVES_TORQUE,
    Rig,
    default_rig,
    load_axis_rig,
    load_rig,
    sources_of,
)
from fingerlab.sessions import CheckReport, Session, check_session, open_session
from fingerlab.sessions.model import CABLES, LEFT_OUT, PHASES
from fingerlab.sessions.recording_files import CLEAN
from fingerlab.sessions.trajectory import motion_of_run

if TYPE_CHECKING:
    from fingerlab.report.line_units import LineUnits
    from fingerlab.sessions.importing import ImportPlan, TextRun


@click.command()
@session_argument
@json_option
def info(session_file: Path, json_target: str | None) -> None:
    """Show what is in a session, and check it against the format.

    Every sample is read once: time that runs backwards, NaN where none may be and a wrong sampling rate
    are errors; gaps and missing force are told.
    """
    session = open_session(session_file)
    bar, report_progress = progress_bar("Checking")
    with bar:
        report = check_session(session, report_progress)
    report.raise_first()
    result = _info_json(session, report)
    if json_target != "-":
        _print_info(session, report)
    if json_target is not None:
        write_json(result, json_target)


@click.command("import")
@click.argument("files", metavar="A.txt|.csv|.mat [B ...]", nargs=-1, required=True, type=PATH)
@click.option(
    "--axis", is_flag=True, help="Logs of one axis of any machine: time, position, torque or current, load."
)
@click.option(
    "--map",
    "mapping",
    metavar="MAPPING",
    default="auto",
    show_default=True,
    help="Which column is which channel: 'auto', an inline text, or a .json or .toml file (see above).",
)
@click.option("--out", "target", metavar="S.h5", type=NEW_FILE, help="Session to write.")
@click.option(
    "--rig",
    "rig_file",
    metavar="RIG.toml",
    type=PATH,
    help="Constants of the bench; without it those of the thesis' rig, partly assumed.",
)
@click.option(
    "--phase",
    "phases",
    multiple=True,
    type=click.Choice(PHASES),
    help="Phase of the files: once for all or once for each.  [default: on_air]",
)
@click.option(
    "--cable",
    "cables",
    multiple=True,
    type=click.Choice(CABLES),
    help="Cable of the files: once for all or once for each.  [default: extension]",
)
@click.option(
    "--trajectory",
    metavar="JSON",
    help='What the motor was told, such as {"kind": "sine"}.  [default: a sine is read from the command]',
)
@click.option(
    "--rate",
    type=Within(min=0, min_open=True),
    metavar="HZ",
    help="Samples a second, where no column holds the time.",
)
@click.option(
    "--torque-constant",
    type=Within(min=0, min_open=True),
    metavar="NM_PER_A",
    help="With --axis: what an ampere gives at the axis, gear included, where no torque was logged: N m/A, "
    "or N/A where the position is a length.",
)
@click.option(
    "--radius",
    type=Within(min=0, min_open=True),
    metavar="M",
    help="With --axis: radius of the arc as which a linear axis is told, or lever of a force, m.  "
    "[default: 0.01]",
)
@click.option("--title", help="Title of the session.  [default: names the files]")
@click.option("--dry-run", is_flag=True, help="Show the mapping and write nothing.")
@click.option("--yes", is_flag=True, help="Do not ask before writing (it asks only on a terminal).")
@json_option
def import_text(
    files: tuple[Path, ...],
    mapping: str,
    target: Path | None,
    rig_file: Path | None,
    phases: tuple[str, ...],
    cables: tuple[str, ...],
    trajectory: str | None,
    rate: float | None,
    axis: bool,
    torque_constant: float | None,
    radius: float | None,
    title: str | None,
    dry_run: bool,
    yes: bool,
    json_target: str | None,
) -> None:
    """Turn text files of the bench, or logs of one axis, into one session, one run a file in the order given.

    Tabs, semicolons, commas or spaces, decimal comma or point, and a header row are recognised. The
    mapping is shown on standard error before anything is written.

    MAPPING is 'auto': by the header's words, such as "MCP (deg)" or "torque (Nm)"; without a header, seven
    columns are taken in the bench's own order: time, command, position, torque, MCP, PIP, force, angles in
    degrees.

    Or an inline text: time=1,motor_command=2:deg,motor_position=3:deg,motor_torque=4:mNm,pip_angle=6:deg:-1
    (channel = column number or header : unit : factor for a flipped sign). Columns that it does not name are
    left out.

    Or a .json or .toml file with the same: motor_command = { column = 2, unit = "deg", scale = 1 }.

    Angles without a unit are degrees. motor_current, which these files lack, follows from the torque by
    the rig's constants and is marked as derived.

    A few rows that cannot be read (empty cells, NaN, a time that comes twice) are gaps: they are left out and
    told. Columns of words are left out.

    With --axis the files are logs of one axis of any machine, as text or as MAT files (version 5 or 7.3;
    each struct in one is a run): time=t:ms,position=q:deg,torque=tau:Nm,load=F:N. Every unit has to be named,
    in the mapping or the header; one of your own takes a factor, x:m:0.0254 or counts:rad:0.00153. A linear
    axis (mm, N) is told as an arc, and --torque-constant is its force, N/A; a force on an axis that turns
    needs --radius, its lever. A positive torque drives towards larger positions; a load has the sign of the
    torque that holds it (the other one is understood, too). They become motor-bench runs of a rig without a
    finger, ready for "fingerlab diagnose".
    """
    from fingerlab.sessions.importing import describe_all, import_files, plan_import

    if target is None and not dry_run:
        raise UserError("The option --out S.h5 is missing; it names the session to write.")
    load = load_axis_rig if axis else load_rig
    rig = load(rig_file) if rig_file else default_rig()
    sources = _text_runs(files, phases, cables, trajectory)
    if axis:
        sources, rig = _of_one_axis(sources, rig if rig_file else None, phases, torque_constant, radius)
    elif torque_constant is not None or radius is not None:
        raise UserError("--torque-constant and --radius belong to --axis; the bench's stand in its rig file.")
    plans = plan_import(sources, mapping, rate)
    for line in describe_all(plans):
        click.echo(line, err=True)
    if axis:
        _refuse_unknown_constant(plans, rig, rig_file)
    else:
        _tell_assumptions(rig_file, phases, cables)
    if dry_run or target is None:
        return
    if not yes and somebody_there():
        click.confirm(f"Write {target}?", default=True, abort=True, err=True)
    bar, report_progress = progress_bar("Importing")
    name = title or f"imported from {', '.join(path.name for path in files)}"
    with bar:
        import_files(plans, target, rig, name, progress=report_progress)
    if json_target is not None:
        session = open_session(target)
        write_json(_info_json(session, check_session(session)), json_target)
    _tell_left_out(plans, target)
    if axis:
        from fingerlab.report.recording_words import short_runs_words

        _tell_if_any(short_runs_words(target))
    if json_target != "-":
        click.echo(f"Wrote {target}: {counted(len(plans), 'run')}.")


@click.command()
@session_argument
@click.option(
    "--to",
    "kind",
    required=True,
    type=click.Choice(("csv", "mat", "parquet", "txt")),
    help="csv, txt, parquet: one file a run; mat: one file a session, a struct a run.",
)
@click.option(
    "--out",
    "folder",
    metavar="DIR",
    required=True,
    type=PATH,
    help="Folder to write to; made where it is missing.",
)
@json_option
def export(session_file: Path, kind: str, folder: Path, json_target: str | None) -> None:
    """Give a session to other tools, with everything that is not a sample beside it as JSON.

    Numbers are SI with the unit in the column's header, in full precision: a txt file that is imported
    again gives the same numbers. Groups and datasets that the session format does not know go to a file
    NAME-extra.h5. Nothing is overwritten.
    """
    from fingerlab.sessions.exporting import export_session

    session = open_session(session_file)
    bar, report_progress = progress_bar("Exporting")
    with bar:
        written = export_session(session, kind, folder, report_progress)
    if json_target is not None:
        write_json({"session": str(session_file), "files": [str(path) for path in written]}, json_target)
    if json_target != "-":
        click.echo(f"Wrote {len(written)} files to {folder}.")


def _text_runs(
    files: tuple[Path, ...], phases: tuple[str, ...], cables: tuple[str, ...], trajectory: str | None
) -> list[TextRun]:
    """The files with what they cannot say of themselves."""
    from fingerlab.sessions.importing import TextRun

    commanded = _trajectory(trajectory)
    each_phase = _each(phases, "on_air", files, "phase")
    each_cable = _each(cables, "extension", files, "cable")
    return [
        TextRun(path, phase, cable, commanded)
        for path, phase, cable in zip(files, each_phase, each_cable, strict=True)
    ]


def _of_one_axis(
    sources: list[TextRun],
    rig: Rig | None,
    phases: tuple[str, ...],
    torque_constant: float | None,
    radius: float | None,
) -> tuple[list[TextRun], Rig]:
    """The files as motor-bench runs, and a rig that knows no finger."""
    from fingerlab.sessions.importing import of_one_axis

    if set(phases) - {"motor_bench"}:
        raise UserError("--axis makes runs of phase motor_bench; leave --phase out.")
    if rig is not None and torque_constant is not None and not {*GIVES_TORQUE} <= rig.untold:
        raise UserError("--torque-constant and --rig both say what a current gives; give one of them.")
    return of_one_axis(sources, rig, torque_constant, radius)


def _refuse_unknown_constant(plans: Sequence[ImportPlan], rig: Rig, rig_file: Path | None) -> None:
    from fingerlab.sessions.importing import refuse_unknown_constant

    for plan in plans:
        refuse_unknown_constant(plan, rig, str(rig_file or ""), "with --torque-constant")


def _tell_left_out(plans: Sequence[ImportPlan], target: Path) -> None:
    """Rows of long files that were left out, of which the plan knew the first block alone."""
    from fingerlab.sessions.importing import left_out_words

    if all(plan.left_out.whole for plan in plans):
        return
    for words in left_out_words(target):
        click.echo(words, err=True)


def _tell_if_any(sentence: str) -> None:
    if sentence:
        click.echo(sentence, err=True)


def _each(given: tuple[str, ...], default: str, files: tuple[Path, ...], name: str) -> tuple[str, ...]:
    """One value a file from an option given never, once, or once for each file."""
    if len(given) <= 1:
        return (given or (default,)) * len(files)
    if len(given) != len(files):
        raise UserError(
            f"--{name} is given {len(given)} times for {len(files)} files; give it once, or once for each."
        )
    return given


def _trajectory(text: str | None) -> dict[str, Any] | None:
    if text is None:
        return None
    return read_object(text, "--trajectory", 'write it like {"kind": "sine"}')


def _tell_assumptions(rig_file: Path | None, phases: tuple[str, ...], cables: tuple[str, ...]) -> None:
    assumed = []
    if not rig_file:
        assumed.append("the rig's masses, lengths, springs and pulley (--rig)")
    if not phases:
        assumed.append("phase on_air (--phase)")
    if not cables:
        assumed.append("cable extension (--cable)")
    if assumed:
        click.echo(f"Assumed: {'; '.join(assumed)}.", err=True)


def _info_json(session: Session, report: CheckReport) -> dict[str, Any]:
    from fingerlab.sessions.exporting import session_metadata

    counts = {check.run: check for check in report.runs}
    result = session_metadata(session)
    for run, item in zip(session.runs, result["runs"], strict=True):
        del item["file"]
        item["seconds"] = run.seconds
        item["gaps"] = counts[run.name].gaps
        item["lost_samples"] = counts[run.name].lost_samples
        item["force_not_read"] = counts[run.name].force_not_read
    result["session"] = str(session.path)
    result["findings"] = [vars(finding) for finding in report.findings]
    return result


def _print_info(session: Session, report: CheckReport) -> None:
    from fingerlab.report.line_units import line_units

    console = table_console(width=110)
    console.print(f"{session.path}: {session.title}", style="bold")
    console.print(f"recorded {session.created}")
    for key in ("operator", "notes", "software", "tags"):
        if key in session.attributes:
            console.print(f"{key}: {session.attributes[key]}")
    ended = [str(session.attributes.get(key, "")) for key in ("ended", "ended_note")]
    if ended[0] not in ("", CLEAN):
        console.print(f"ended: {ended[0]}. {ended[1]}".strip())
    line = line_units([session])
    console.print(_runs_table(session, report, line))
    if line.radius:
        console.print(line.file)
    constants = _rig_table(session.rig, line, str(session.attributes["rig"]))
    console.print(constants if constants.row_count else "no constant of the machine was told")
    for run in session.runs:
        if LEFT_OUT in run.attributes:
            console.print(f"run {run.name}: when it was imported {run.attributes[LEFT_OUT]}")
    for finding in report.findings:
        where = f"run {finding.run}: " if finding.run else ""
        console.print(f"{finding.level}: {where}{finding.text}")
    seconds = sum(run.seconds for run in session.runs)
    console.print(f"{len(session.runs)} runs, {seconds:.1f} s; the file keeps the session format.")


def _runs_table(session: Session, report: CheckReport, line: LineUnits) -> Table:
    """One row a run; channels are listed where they differ from those of most runs."""
    usual = Counter(tuple(run.units) for run in session.runs).most_common(1)[0][0]
    table = result_table(
        *("run", "phase", "cable", "trajectory", ">seconds", ">samples", ">per second", ">gaps"),
        caption=f"channels: {_channel_words(usual, line)}",
        caption_justify="left",
    )
    gaps = {check.run: check.gaps for check in report.runs}
    for run in session.runs:
        words = motion_of_run(run, line.radius)
        if tuple(run.units) != usual:
            words += f"; channels {_channel_words(run.units, line)}"
        table.add_row(
            run.name,
            run.phase,
            run.cable,
            words,
            f"{run.seconds:.3f}",
            str(run.length),
            f"{run.sample_rate_hz:g}",
            str(gaps[run.name]),
        )
    return table


def _channel_words(names: Iterable[str], line: LineUnits) -> str:
    """Channels as the file names them, and what each is along the line of a linear axis."""
    told = ((name, line.called(name)) for name in names)
    return ", ".join(f"{name} ({words})" if words != name.replace("_", " ") else name for name, words in told)


def _rig_table(rig: Rig, line: LineUnits, stored: str) -> Table:
    """The bench's constants with tolerance and source; angles in degrees, the rest in SI.

    Args:
        line: units of its axis.
        stored: the rig text as the session holds it, to tell its constants from those of the program.
    """
    given = json.loads(stored)
    table = result_table("constant", ">value", "unit", "tolerance", "source")
    sources = sources_of(rig)
    for one in line.constants(rig):
        value, unit = (math.degrees(one.value), "°") if one.unit == "rad" else (one.value, one.unit)
        origin = "session" if one.key in (given.get(one.part) or {}) else "not in the session: default"
        tolerance = rig.tolerance_words(one.key)
        table.add_row(one.name, f"{value:.5g}", unit, tolerance, sources.get(one.key, origin))
    return table
