"""Pages that are made from the program itself: the catalogue of effects, the commands, limits, constants.

MkDocs calls this file as a hook (``mkdocs.yml``) and the pages come into the build without being stored, so
that they cannot grow old. To look at them as files::

    python docs/generate.py FOLDER
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import click

from fingerlab.cli.main import COMMANDS, cli
from fingerlab.diagnosis.equations.parameters import nuisance_ranges
from fingerlab.diagnosis.settings import ARM_RATIO_SPREADS, USUAL_RATIOS, USUAL_SPREAD
from fingerlab.effects import CATALOGUE, Effect
from fingerlab.physics.parameter import Parameter
from fingerlab.report.equation_text import markdown_words
from fingerlab.rig.file import CONSTANT_UNITS, default_rig, sources_of
from fingerlab.rig.limits import Limits, limits_table

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))
from arrows import MARK as ARROWS  # noqa: E402
from arrows import drawing  # noqa: E402
from fingerprints import picture  # noqa: E402  (stands beside this file, in no package)
from stated import page as decisions  # noqa: E402
from summary import MARK, summary  # noqa: E402

ACTS_ON = {
    "joint_torque": "joint torque (MCP and PIP)",
    "cable_kinematics": "cable length",
    "motor_torque": "motor torque",
    "endpoint_force": "endpoint force",
}
EQUATIONS = {
    "MCP": "the MCP equation",
    "PIP": "the PIP equation",
    "CABLE": "the cable equation",
    "BENCH": "the motor-bench equation",
    "TIP": "the equation of the fingertip's depth",
}
SPECIAL = {
    "delay": "This one is not a column of the equations: the motor's channels are shifted in the fit.",
    "slack": "This one is not a column of the equations: the cable equation counts one-sidedly in the fit.",
}
COMMENT = "<!-- Made by docs/generate.py from the program; do not edit. -->\n\n"


def pages() -> dict[str, str]:
    """Every generated page: path below ``docs/`` -> Markdown."""
    made = {"catalogue/index.md": _index()}
    made |= {f"catalogue/{e.id}.md": _effect_page(e) for e in CATALOGUE.values()}
    made |= {
        "commands.md": _commands(),
        "limits.md": _limits(),
        "nuisances.md": _nuisances(),
        "constants.md": _constants(),
        "decisions.md": decisions(),
    }
    return {path: COMMENT + text for path, text in made.items()}


def families() -> dict[str, list[Effect]]:
    """The effects of each family, in the order of the catalogue."""
    found: dict[str, list[Effect]] = {}
    for effect in CATALOGUE.values():
        found.setdefault(effect.family, []).append(effect)
    return found


def _index() -> str:
    lines = [
        "# Catalogue of effects",
        "",
        f"{len(CATALOGUE)} effects that the nominal model leaves out. Each page is made from the effect's "
        "file, `fingerlab/effects/ID.py`, from which the fit, the ranking, the plots and the report work "
        "too. `fingerlab effects` prints the same list.",
        "",
        "An effect adds a torque τ₁, τ₂ to the joint equations, a length x to the cable equation, or a "
        "torque τₘ on the motor side; these equations are in [theory](../theory.md).",
    ]
    for family, effects in families().items():
        lines += ["", f"## {family}", "", "| effect | id | changes |", "|---|---|---|"]
        for effect in effects:
            changes = ", ".join(ACTS_ON[name] for name in effect.acts_on)
            lines.append(f"| [{effect.title}]({effect.id}.md) | `{effect.id}` | {changes} |")
    return "\n".join(lines) + "\n"


def _effect_page(effect: Effect) -> str:
    formula = effect.formula
    assert formula is not None, effect.id
    changes = ", ".join(ACTS_ON[name] for name in effect.acts_on)
    parts = [
        f"# {effect.title}",
        f"`{effect.id}` changes: {changes}.",
        effect.explanation,
        "## Equation",
        f"$$\n{formula.equation}\n$$",
        f"{markdown_words(formula.symbols)} The other symbols are those of [theory](../theory.md).",
        f"Source: {formula.source}",
    ]
    if effect.special:
        parts.append(SPECIAL[effect.special])
    parts += ["## Unknowns", *_unknowns(effect)]
    parts += ["## How it shows", *_fingerprint(effect)]
    parts += ["## How to tell", f"What reveals it: {effect.reveal}."]
    parts += _look_alikes(formula.alike)
    parts += ["## What mends it", effect.mend]
    parts += _behaviour(effect)
    return "\n\n".join(parts) + "\n"


def _unknowns(effect: Effect) -> Iterator[str]:
    gains = effect.unknowns
    if gains:
        yield gain_table(gains)
        yield '"Typical" is a strength that would matter; it scales the fit and its prior.'
    if effect.relaxes:
        yield "Every model carries this within a [narrow range](../nuisances.md); the effect sets it free."
    usual = [name for name in effect.shape_units if all(name in shape for shape in effect.shapes)]
    shapes = {name: sorted({shape[name] for shape in effect.shapes}) for name in usual}
    if shapes:
        rows = [
            f"| {name.removesuffix('_deg').replace('_', ' ')} | {effect.shape_units[name]} | "
            f"{', '.join(f'{value:g}' for value in values)} |"
            for name, values in shapes.items()
        ]
        yield "Shapes that are tried, one after the other:"
        yield "\n".join(["| shape | unit | values |", "|---|---|---|", *rows])
    if not gains and not shapes:
        yield "It has no unknown of its own."


def gain_table(gains: Mapping[str, Parameter]) -> str:
    """Unknowns with unit, range, typical strength and source, as a Markdown table."""
    rows = [
        f"| `{name}` | {gain.title or name.replace('_', ' ')} | {gain.unit} | "
        f"{gain.low:g} to {gain.high:g} | {gain.typical:g} | {gain.source} |"
        for name, gain in gains.items()
    ]
    head = "| name | what | unit | plausible range | typical | source |\n|---|---|---|---|---|---|"
    return "\n".join([head, *rows])


def _fingerprint(effect: Effect) -> list[str]:
    said = (
        f"Its fingerprint is drawn in {EQUATIONS[effect.equation.name]}: the residual against "
        f"{effect.coordinate}, with the effect's own curve over it."
    )
    drawn = picture(effect)
    if not drawn:
        return [said]
    made_up = (
        "The effect's own course at a typical strength in a made-up run (`docs/fingerprints.py`): the "
        "motor turns by two sines against a load like a spring, with the extension cable."
    )
    return [said, f'<div class="fingerprint">{drawn}</div>', made_up]


def _look_alikes(ids: Sequence[str]) -> list[str]:
    if not ids:
        return ["Nothing else in the catalogue has a course like this one."]
    links = ", ".join(f"[{CATALOGUE[name].title}]({name}.md)" for name in ids)
    return [
        f"Easily taken for it: {links}. Which of them a session can tell apart is a property of the session: "
        "`diagnose` says so each time, and proposes the run that separates the closest two."
    ]


def _behaviour(effect: Effect) -> list[str]:
    said = []
    if effect.phases:
        said.append(f"It acts in {' and '.join(effect.phases)} runs only.")
    if effect.bench is True:
        said.append("It can act on the motor bench too, without a finger.")
    if any(gain.varies_between_runs for gain in effect.gains.values()):
        said.append("Its strength may differ by some per cent from run to run.")
    if any(gain.holds_at_rest for gain in effect.gains.values()):
        said.append("While nothing moves it may hold any value between its extremes.")
    return ["## In the fit", " ".join(said)] if said else []


def _commands() -> str:
    parts = [
        "# Commands",
        "The text of each `--help`. Exit codes: 0 success, 2 bad usage or bad input with one sentence that "
        "says what is wrong, 130 stopped with Ctrl-C.",
    ]
    for word in COMMANDS:
        with click.Context(cli, info_name="fingerlab") as parent:
            command = cli.get_command(parent, word)
            assert command is not None, word
            with click.Context(command, info_name=word, parent=parent, max_content_width=90) as context:
                parts += [f"## {word}", f"```text\n{command.get_help(context)}\n```"]
    return "\n\n".join(parts) + "\n"


def _limits() -> str:
    default = default_rig().limits.sources
    rows = [
        f"| {_title(row.name)} | {row.value:.4g} | {_with_degrees(row.value, row.unit)} | "
        f"{'rig file; default: ' if row.source == 'rig file' else ''}"
        f"{default.get(row.name, row.source)} |"
        for row in limits_table(Limits())
    ]
    return "\n".join(
        [
            "# Limits of the control loop",
            "",
            "The control loop stops the motor beyond these, window or no window. A rig file's section "
            '`[limits]` sets each by its name, such as `late_time = { value = 0.03, unit = "s" }`. Those '
            'whose source begins with "rig file" are the bench\'s (the values here are those of the default '
            "rig); the others are the loop's and are seldom set.",
            "",
            "| limit | value | unit | source |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )


def _title(name: str) -> str:
    return name.replace("_", " ").replace("mcp", "MCP").replace("pip", "PIP")


def _with_degrees(value: float, unit: str) -> str:
    """A unit; of an angle and of its rate with the value in degrees."""
    return f"{unit} ({math.degrees(value):.4g}{unit.replace('rad', '°')})" if "rad" in unit else unit


def _nuisances() -> str:
    return (
        "# Unknowns of every model\n\n"
        "What every fit leaves open besides the effects, with the ranges for the default rig. Moment arms, "
        "losses and cable offset are free for each routing by itself; but flexion over extension arm must be "
        f"near {USUAL_RATIOS[0]:g} at the MCP and {USUAL_RATIOS[1]:g} at the PIP joint: both logarithms "
        f"together within {ARM_RATIO_SPREADS:g} times {USUAL_SPREAD:g}, or times the rig file's tolerance "
        "`moment_arm` (assumed; see `routing_change`). Constants of the rig have their "
        "tolerance as a prior and a hard bound at 2.5 tolerances; their numbers are relative, unit 1.\n\n"
        + gain_table(nuisance_ranges(default_rig()))
        + "\n"
    )


def _constants() -> str:
    rig = default_rig()
    sources = sources_of(rig)
    rows = []
    for part in (rig.finger, rig.motor):
        for spec in fields(part) if part is not None else ():
            value = getattr(part, spec.name)
            if value is not None:
                tolerance = f"± {100 * rig.tolerance_of(spec.name):g} %"
                source = sources.get(spec.name, "assumed")
                unit = CONSTANT_UNITS[spec.name]
                title = _title(spec.name)
                rows.append(f"| {title} | {value:.6g} | {unit} | {tolerance} | {source} |")
    return "\n".join(
        [
            "# Constants of the default rig",
            "",
            "What the equations of [theory](theory.md) take as known, for the rig that is used where no "
            "[rig file](rig.md#the-rig-file) is given. A session carries its own; the tolerance is one "
            "standard deviation.",
            "",
            "| constant | value | unit | tolerance | source |",
            "|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


# What MkDocs calls.


def on_config(config: Any) -> Any:
    """Put the effects into the navigation, by family, and pages that it does not name under Validation."""
    config.nav = navigation(config.nav or [])
    return config


def navigation(nav: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The navigation of ``mkdocs.yml`` with what is only known when the pages are built."""
    pages = [
        {family: [{effect.title: f"catalogue/{effect.id}.md"} for effect in effects]}
        for family, effects in families().items()
    ]
    named = set(_named(nav))
    others = [path.name for path in sorted(DOCS.glob("*.md")) if path.name not in named]
    more: dict[str, list[Any]] = {"Catalogue": ["catalogue/index.md", *pages], "Validation": others}
    result = []
    for entry in nav:
        for title, part in entry.items():
            given = part if isinstance(part, list) else []
            result.append({title: [*given, *more[title]] if title in more else part})
    return result


def _named(part: Any) -> Iterator[str]:
    """Pages that a part of the navigation names."""
    if isinstance(part, str):
        yield part
    elif isinstance(part, Mapping):
        yield from _named(list(part.values()))
    elif isinstance(part, list):
        for inner in part:
            yield from _named(inner)


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages to the build."""
    from mkdocs.structure.files import File

    for path, text in pages().items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the summary of the measurements, and the arrows, where a page asks for them."""
    for mark, make in ((MARK, lambda: summary(DOCS)), (ARROWS, lambda: f"<div>{drawing()}</div>")):
        if mark in markdown:
            markdown = markdown.replace(mark, make())
    return markdown


FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


FUNCTION = re.compile(r"<mi>(?:cos|sin|tan|sgn|max|min|ln)</mi>")
THIN = '<mspace width="0.14em"></mspace>'
"""Room about the name of a function, which the converter leaves out."""


def on_page_content(html: str, **_: Any) -> str:
    """Formulas as MathML, which browsers show without a script and without a network."""
    from html import unescape

    from latex2mathml.converter import convert

    def formula(found: re.Match[str]) -> str:
        display = "inline" if found[2] == "(" else "block"
        made = str(convert(unescape(found[3]).strip(), display=display))
        return FUNCTION.sub(rf"<mrow>{THIN}\g<0>{THIN}</mrow>", made)

    return FORMULA.sub(formula, html)


SNIPPET = re.compile(r'^--8<-- "([\w.]+)"$', re.MULTILINE)
"""A file that stands inside a page; the packaged program has no source files to take it from."""


def main(arguments: list[str]) -> int:
    """Write the generated pages into a folder, and into its pages what they ask for."""
    if len(arguments) != 1:
        print("usage: python docs/generate.py FOLDER", file=sys.stderr)
        return 2
    for path, text in pages().items():
        target = Path(arguments[0]) / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    for path in Path(arguments[0]).rglob("*.md"):  # those that are there already
        text = path.read_text(encoding="utf-8")
        text = SNIPPET.sub(lambda found: (DOCS / found[1]).read_text(encoding="utf-8").rstrip(), text)
        path.write_text(on_page_markdown(text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
