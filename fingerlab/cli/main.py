"""Entry point: finds the command, and turns every expected failure into one sentence and exit code 2.

A command's module is imported only when that command runs, so that ``fingerlab info`` does not wait
for the twin's compiler.
"""

from __future__ import annotations

import importlib
import io
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import click

import fingerlab
from fingerlab.core.errors import UserError
from fingerlab.core.text import shown

MOST_LETTERS = 1200
"""Of a sentence about bad input; what is longer quotes a file at length."""

COMMANDS = {
    "simulate": ("fingerlab.cli.simulate:simulate", "Record a session from the simulated rig."),
    "record": ("fingerlab.cli.record:record", "Record a session from a device, without the window."),
    "reveal": ("fingerlab.cli.simulate:reveal", "Tell which effect a simulated session hides."),
    "info": ("fingerlab.cli.sessions:info", "Show and check what is in a session."),
    "import": ("fingerlab.cli.sessions:import_text", "Turn text files, or logs of one axis, into a session."),
    "export": ("fingerlab.cli.sessions:export", "Give a session to other tools."),
    "calibrate": ("fingerlab.cli.bench:calibrate", "Calibrate a sensor from a stepped recording."),
    "fit": ("fingerlab.cli.fit:fit", "Fit moment arms and friction losses."),
    "predict": ("fingerlab.cli.predict:predict", "Predict the endpoint force of contact runs."),
    "inverse": ("fingerlab.cli.predict:inverse", "Give the motor torque that a wanted force needs."),
    "trial": ("fingerlab.cli.predict:trial", "Tell by how much a found model lowered the force error."),
    "diagnose": ("fingerlab.cli.diagnose:diagnose", "Tell which physical effect the model is missing."),
    "compare": ("fingerlab.cli.compare:compare", "Compare saved models on the same held-out runs."),
    "batch": ("fingerlab.cli.batch:batch", "Diagnose every session below a folder."),
    "effects": ("fingerlab.cli.effects:effects", "List the catalogue, and let in effects of your own."),
    "devices": ("fingerlab.cli.bench:devices", "List what can be driven, and forget devices of your own."),
    "replicate": ("fingerlab.cli.simulate:replicate", "Repeat the thesis' experiment on the simulated rig."),
    "check-rig": ("fingerlab.cli.bench:check_rig", "Confirm channels, signs and limits of the bench."),
    "report": ("fingerlab.cli.diagnose:report", "Write the whole comparison as one page."),
}
"""Command word -> ``module:object`` that holds the click command, and what it does in one line.

The line stands here as well so that ``fingerlab --help`` need not import every command.
"""


class LazyGroup(click.Group):
    """A group that imports a command's module when the command is asked for, and not before."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        module, attribute = COMMANDS[name][0].split(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and not args[0].startswith("-") and args[0] not in COMMANDS:
            if Path(args[0]).is_file():
                return "open", OPEN, args
            raise click.UsageError(
                f"There is no command and no file '{args[0]}'; the commands are {', '.join(COMMANDS)}.", ctx
            )
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(word, line) for word, (_, line) in COMMANDS.items()])


def _open(files: tuple[Path, ...]) -> None:
    click.get_current_context().exit(_window(files))


def _window(files: Sequence[Path] = ()) -> int:
    """The desktop application; its exit code."""
    application = importlib.import_module("fingerlab.ui.app.application")
    code: int = application.run([str(path) for path in files])
    return code


PATH = click.Path(exists=True, dir_okay=False, path_type=Path)
OPEN = click.Command(
    "open",
    callback=_open,
    params=[click.Argument(["files"], nargs=-1, type=PATH)],
    help="Open session files in the window.",
)
"""What happens where a file stands in place of a command."""


@click.group(cls=LazyGroup, invoke_without_command=True)
@click.version_option(fingerlab.__version__)
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Drives a cable-driven finger rig, records it, and tells which physical effect its model is missing.

    Without a command it opens the desktop application; session files in place of one are opened there.
    """
    if ctx.invoked_subcommand is None:
        ctx.exit(_window())


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 on success, 2 on bad usage or bad input, 130 on Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):
        # A Windows console may lack a Greek letter; that must not end a command that has done its work.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        with warnings.catch_warnings():
            # What numpy says of numbers beyond all bounds in a stranger's file helps nobody at a terminal.
            warnings.simplefilter("ignore", RuntimeWarning)
            code = cli.main(args=arguments, prog_name="fingerlab", standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        _fail(_plain(error.format_message()))
    except UserError as error:
        _fail(str(error))
    except (click.Abort, KeyboardInterrupt):
        click.echo("Stopped.", err=True)
        sys.exit(130)


def _plain(sentence: str) -> str:
    """What click says of numbers, in words that are not its own."""
    for kind, said in (("integer", "a whole number"), ("float", "a number")):
        for name in (f"a valid {kind} range", f"a valid {kind}"):
            sentence = sentence.replace(f"is not {name}.", f"is not {said}.")
    return sentence


def _fail(sentence: str) -> None:
    sentence = shown(" ".join(sentence.split()), MOST_LETTERS)
    click.echo(f"fingerlab: {sentence}", err=True)
    sys.exit(2)


if __name__ == "__main__":
    main()
