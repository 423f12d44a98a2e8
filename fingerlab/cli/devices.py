"""``fingerlab devices``: what there is to drive, and the devices of one's own that were confirmed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from fingerlab.cli.common import PATH, json_option, write_json
from fingerlab.core.errors import UserError
from fingerlab.devices import choosing
from fingerlab.devices.choosing import detect
from fingerlab.devices.protocol import FoundDevice
from fingerlab.rig.file import load_rig

STATES = {
    "trusted": "confirmed in the window",
    "changed": "changed since it was confirmed: the window asks again",
    "missing": "confirmed, and no longer there",
}


@click.command(short_help="List what can be driven, and forget devices of your own.")
@click.option("--rig", "rig_file", type=PATH, help="Rig file that names the card.")
@click.option(
    "--untrust",
    metavar="FILE",
    type=PATH,
    help="Forget that this device of your own was confirmed.",
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
        _print(found, known)
    if json_target is not None:
        write_json(_to_json(found, known), json_target)


def _print(found: tuple[FoundDevice, ...], known: tuple[tuple[Path, str], ...]) -> None:
    for one in found:
        click.echo(f"{one.name}  {'can be used' if one.available else 'cannot be used'}: {one.sentence}")
    for path, state in known:
        click.echo(f"own:{path}  {STATES[state]}")
    if not known:
        click.echo("No device of your own was confirmed.")


def _to_json(found: tuple[FoundDevice, ...], known: tuple[tuple[Path, str], ...]) -> dict[str, Any]:
    return {
        "schema": 1,
        "devices": [{"name": f.name, "available": f.available, "sentence": f.sentence} for f in found],
        "own_files": [
            {"file": str(path), "state": "confirmed" if state == "trusted" else state}
            for path, state in known
        ],
    }
