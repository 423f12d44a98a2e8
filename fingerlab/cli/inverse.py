"""``fingerlab inverse``: the motor torque that a wanted endpoint force needs, as a trajectory."""

from __future__ import annotations

import json
import math
from pathlib import Path

import click

from fingerlab.cli.common import PATH, json_option, write_json, write_text_safely
from fingerlab.core.errors import UserError
from fingerlab.core.files import refuse_taken
from fingerlab.diagnosis.signals.scales import find_scales
from fingerlab.models.file import load_model
from fingerlab.prediction.force import contact_runs
from fingerlab.prediction.inverse import TorquePlan, needed_torque, plan_json, predictors
from fingerlab.prediction.target import ContactPose, pose_by_hand, pose_of_run, wanted_force, words_of
from fingerlab.sessions import Session, open_session


@click.command()
@click.argument("session_file", metavar="S.h5", type=PATH)
@click.option("--model", "model_file", metavar="M.json", type=PATH, required=True, help="As for 'predict'.")
@click.option(
    "--wanted",
    metavar="JSON|FILE",
    required=True,
    help='Wanted force: JSON such as {"kind": "sine", "mean_n": 1, "amplitude_n": 0.5, "frequency_hz": 0.5}, '
    "a file of it, or a text table of time (s) and force (N). Kinds: sine, ramp_hold, steps, file.",
)
@click.option("--run", "run_name", help="Contact run that says how the finger stands; the first by default.")
@click.option("--pose", nargs=2, type=float, metavar="MCP PIP", help="Joint angles in degrees instead.")
@click.option("--parameters", help="Which predictor of the model; the first by default ('--json' names all).")
@click.option("--out", type=PATH, help="Trajectory to write, for 'record' and 'simulate'.")
@json_option
def inverse(
    session_file: Path,
    model_file: Path,
    wanted: str,
    run_name: str | None,
    pose: tuple[float, float] | None,
    parameters: str | None,
    out: Path | None,
    json_target: str | None,
) -> None:
    """Give the motor torque that a wanted endpoint force needs, with its interval, and check the limits.

    The finger presses as it does in a contact run of the session. What is written with --out runs with
    'fingerlab record --trajectory FILE', in the simulated rig, and in the Acquire tab.
    """
    if out is not None:
        refuse_taken(out)
    session = open_session(session_file)
    stands = _pose(session, run_name, pose)
    known = predictors(load_model(model_file), str(model_file), stands.cable)
    name = parameters or next(iter(known))
    if name not in known:
        raise UserError(f"{model_file} has no predictor '{name}'; it has: {'; '.join(known)}.")
    plan = needed_torque(wanted_force(wanted, "--wanted"), known[name], stands, session.rig, str(model_file))
    if out is not None:
        write_text_safely(out, json.dumps(plan.experiment(), indent=1) + "\n")
    if json_target != "-":
        _print(plan, name, out)
    if json_target is not None:
        told = {**plan_json(plan), "session": str(session.path), "predictor": name, "predictors": list(known)}
        write_json(told, json_target)


def _pose(session: Session, run_name: str | None, angles: tuple[float, float] | None) -> ContactPose:
    if angles is not None:
        if run_name is not None:
            raise UserError("Give either --run or --pose, not both.")
        return pose_by_hand(math.radians(angles[0]), math.radians(angles[1]))
    runs = {run.name: run for run in contact_runs(session)}
    if not runs:
        raise UserError(
            f"{session.path} has no contact run with a cable; give --pose with the "
            "two joint angles in degrees."
        )
    if run_name is not None and run_name not in runs:
        raise UserError(f"{session.path} has no contact run '{run_name}'; it has {', '.join(runs)}.")
    return pose_of_run(runs[run_name or next(iter(runs))], find_scales([session]))


def _print(plan: TorquePlan, name: str, out: Path | None) -> None:
    angles = words_of(plan.pose)
    click.echo(f"Predictor: {name}.")
    click.echo(
        f"Finger as in {plan.pose.source}: MCP {angles['mcp_deg']:.1f}°, PIP {angles['pip_deg']:.1f}°, "
        f"{plan.pose.cable} cable."
    )
    half = plan.half_width
    known = f" ± {1e3 * half.mean():.2g}" if half.size and half.min() == half.min() else ""
    click.echo(
        f"{plan.force.min():.3g} to {plan.force.max():.3g} N need {1e3 * plan.torque.min():.4g} to "
        f"{1e3 * plan.torque.max():.4g}{known} mN m ({plan.current.min():.3g} to "
        f"{plan.current.max():.3g} A); the rig allows {1e3 * plan.torque_limit:.4g} mN m."
    )
    for sentence in (*plan.beyond, *plan.warnings):
        click.echo(sentence)
    if out is not None:
        click.echo(f"Written to {out}; take it with 'fingerlab record --trajectory {out}'.", err=True)
