"""Entry point: finds the command, and turns every expected failure into one sentence and exit code 2.

A command's module is imported only when that command runs, so that ``fingerlab info`` does not wait
for the twin's compiler.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

import click

import fingerlab
from fingerlab.errors import UserError

COMMANDS = {
    "simulate": "fingerlab.cli.simulate:simulate",
    "reveal": "fingerlab.cli.simulate:reveal",
    "info": "fingerlab.cli.sessions:info",
    "import": "fingerlab.cli.sessions:import_text",
    "export": "fingerlab.cli.sessions:export",
    "calibrate": "fingerlab.cli.calibrate:calibrate",
    "fit": "fingerlab.cli.fit:fit",
    "predict": "fingerlab.cli.predict:predict",
    "diagnose": "fingerlab.cli.diagnose:diagnose",
    "replicate": "fingerlab.cli.replicate:replicate",
    "report": "fingerlab.cli.report:report",
}
"""Command word -> ``module:object`` that holds the click command."""


class LazyGroup(click.Group):
    """A group that imports a command's module when the command is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        target = COMMANDS.get(name)
        if target is None:
            return None
        module, attribute = target.split(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command


@click.group(cls=LazyGroup, invoke_without_command=True)
@click.version_option(fingerlab.__version__)
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Drives a cable-driven finger rig, records it, and tells which physical effect its model is missing.

    Without a command it opens the desktop application.
    """
    if ctx.invoked_subcommand is None:
        application = importlib.import_module("fingerlab.ui.application")
        ctx.exit(application.run([]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 on success, 2 on bad usage or bad input, 130 on Ctrl-C."""
    try:
        code = cli.main(args=arguments, prog_name="fingerlab", standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except click.ClickException as error:
        _fail(" ".join(error.format_message().split()))
    except UserError as error:
        _fail(str(error))
    except (click.Abort, KeyboardInterrupt):
        click.echo("Stopped.", err=True)
        sys.exit(130)


def _fail(sentence: str) -> None:
    click.echo(f"fingerlab: {sentence}", err=True)
    sys.exit(2)


if __name__ == "__main__":
    main()
