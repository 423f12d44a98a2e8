"""``fingerlab effects``: the catalogue, and a user's own effects that join it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fingerlab.cli.common import PATH, json_option, somebody_there, write_json
from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken

if TYPE_CHECKING:
    from rich.text import Text

    from fingerlab.core.trust import OwnSource
    from fingerlab.effects.base import Effect
    from fingerlab.effects.own import OwnFile
    from fingerlab.physics.parameter import Parameter

SHOWN_LINES = 60
"""Lines of a file that are shown before it is confirmed; a longer one is looked at in an editor."""


@click.command(short_help="List the catalogue, and let in effects of your own.")
@click.option("--folder", metavar="DIR", type=PATH, help="Look for own effects in DIR.")
@click.option("--trust", metavar="FILE", type=PATH, help="Let this file of the folder be run.")
@click.option("--untrust", metavar="FILE", type=PATH, help="Do not run this file any more.")
@click.option(
    "--template", metavar="FILE", type=PATH, help="Write a new file of an own effect, to be edited."
)
@click.option("--forget", is_flag=True, help="Forget the folder and every file that was confirmed.")
@json_option
def effects(
    folder: Path | None,
    trust: Path | None,
    untrust: Path | None,
    template: Path | None,
    forget: bool,
    json_target: str | None,
) -> None:
    """List every effect that a diagnosis can rank: equations, parameters, ranges and their sources.

    An effect of your own is one small Python file in a folder that you choose. It runs only after you have
    confirmed it with --trust, and after a change only when you confirm it again; --untrust takes that back.
    """
    from fingerlab.effects import CATALOGUE, own

    if forget and (folder or trust or untrust or template):
        raise UserError("--forget forgets the folder and all files; leave out --forget, or all else.")
    if trust is not None and untrust is not None:
        raise UserError("--trust and --untrust together make no sense; give one of them.")
    if forget:
        own.forget()
        click.echo("The folder of own effects and all confirmations are forgotten.", err=True)
    if folder is not None:
        chosen = own.set_folder(folder)
        click.echo(f"Own effects are looked for in {chosen}.", err=True)
        if somebody_there() and trust is None:
            for file in own.own_files(CATALOGUE):
                if file.state != "trusted":
                    _ask_and_trust(file.source)
    if template is not None:
        refuse_taken(template)
        own.save_own(template, own.template(template), choose=False)
        click.echo(f"{template} is written; {own.how_to_let_in(template)}.", err=True)
    if trust is not None:
        _ask_and_trust(own.find(trust))
    if untrust is not None:
        click.echo(f"{own.distrust(untrust)} is not run any more.", err=True)
    files = own.own_files(CATALOGUE)
    for file in files:
        if file.notice:
            click.echo(file.notice, err=True)
    if json_target is not None:
        write_json(_to_json(files), json_target)
    elif trust is None and untrust is None and template is None and not forget:
        _print(files)


def _ask_and_trust(source: OwnSource) -> None:
    """Ask on a terminal, once; elsewhere the option itself, with the file's name, is the answer.

    Raises:
        UserError: the file was confirmed and does not work.
    """
    from fingerlab.effects import CATALOGUE, own

    if somebody_there():
        lines = source.content.decode("utf-8", errors="replace").splitlines()
        click.echo("\n".join(lines[:SHOWN_LINES]), err=True)
        if len(lines) > SHOWN_LINES:
            click.echo(f"... {len(lines) - SHOWN_LINES} more lines; look at them in an editor.", err=True)
        question = f"{source.file} is a program and may do all that you may. Run it now and from now on?"
        if not click.confirm(question, default=False, err=True):
            click.echo(f"{source.file} is not run.", err=True)
            return
    file = own.trust(source, CATALOGUE)
    if file.problem:
        raise UserError(file.problem)
    names = ", ".join(effect.id for effect in file.effects)
    click.echo(f"{source.file} is confirmed; it adds {names}.", err=True)


def _to_json(files: tuple[OwnFile, ...]) -> dict[str, Any]:
    from fingerlab.core.trust import read_settings
    from fingerlab.effects import CATALOGUE

    folder = read_settings().folder
    listed = [_effect_json(effect, None) for effect in CATALOGUE.values()]
    listed += [_effect_json(effect, file.source.file) for file in files for effect in file.effects]
    return {
        "schema": 1,
        "folder": None if folder is None else str(folder),
        "effects": listed,
        "own_files": [
            {
                "file": file.source.file,
                "sha256": file.source.sha256,
                "state": file.state,
                "effects": [effect.id for effect in file.effects],
                "problem": file.problem or None,
            }
            for file in files
        ],
    }


def _effect_json(effect: Effect, file: str | None) -> dict[str, Any]:
    gains: dict[str, Any] = {
        name: {
            "unit": gain.unit,
            "low": gain.low,
            "high": gain.high,
            "typical": gain.typical,
            "source": gain.source,
            "title": gain.title,
        }
        for name, gain in effect.unknowns.items()
    }
    grid = {
        name: {"unit": unit, "values": [float(s[name]) for s in effect.shapes]}
        for name, unit in effect.shape_units.items()
        if all(name in s for s in effect.shapes)
    }
    return {
        "id": effect.id,
        "title": effect.title,
        "own": file is not None,
        "file": file,
        "equations": list(effect.acts_on),
        "phases": list(effect.phases),
        "motor_bench": effect.bench is True,
        "coordinate": effect.coordinate,
        "explanation": effect.explanation,
        "reveal": effect.reveal,
        "mend": effect.mend,
        "parameters": gains,
        "grid": grid,
    }


def _print(files: tuple[OwnFile, ...]) -> None:
    """One paragraph an effect, made to fit 80 columns."""
    from rich.text import Text

    from fingerlab.cli.common import table_console
    from fingerlab.effects import CATALOGUE

    console = table_console()
    for effect in CATALOGUE.values():
        console.print(_paragraph(effect, ""))
    for file in files:
        for effect in file.effects:
            console.print(_paragraph(effect, f"your own, from {file.source.file}"))
    total = len(CATALOGUE) + sum(len(file.effects) for file in files)
    console.print(Text(f"{total} effects, {total - len(CATALOGUE)} of them your own.", style="dim"))


def _paragraph(effect: Effect, mark: str) -> Text:
    from rich.text import Text

    from fingerlab.report.diagnosis_words import FAMILY_TITLES
    from fingerlab.report.parameter_words import parameter_titles

    text = Text()
    text.append(effect.id, style="bold")
    text.append(f"  {effect.title}\n")
    if mark:
        text.append(f"  {mark}\n", style="italic")
    where = ", ".join(FAMILY_TITLES[family].lower() for family in effect.acts_on)
    text.append(f"  acts on {where}; seen against {effect.coordinate}\n")
    gains = effect.unknowns
    titles = parameter_titles(effect.id, list(gains))
    for name, gain in gains.items():
        text.append(f"  {titles[name]}: {_range_words(gain)} ({gain.source})\n")
    for name, unit in effect.shape_units.items():
        values = sorted({float(s[name]) for s in effect.shapes if name in s})
        if not values:
            continue
        shown = ", ".join(f"{value:g}" for value in values)
        text.append(f"  {name.removesuffix('_deg').replace('_', ' ')}: tried at {shown}{_unit(unit)}\n")
    return text


def _range_words(gain: Parameter) -> str:
    from fingerlab.core.text import largest_of, screen_unit, with_minus

    unit = screen_unit(gain.unit, largest_of((gain.low, gain.high)))
    low, high = (with_minus(f"{value * unit.factor:.4g}") for value in (gain.low, gain.high))
    return f"{low} to {unit.after(high)}"


def _unit(unit: str) -> str:
    return "" if unit in ("", "1") else f" {unit}"
