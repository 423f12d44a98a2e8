"""The bench as built: what its preset holds, the story of a short session, and the committed page."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from fingerlab.twin.protocols import AS_BUILT, PRACTICE, load_preset
from fingerlab.twin.session import write_session
from tests.diagnosis.test_no_alarm import shortened
from tests.hidden import as_built, as_built_page

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / as_built.PAGE


def cells(columns: int, first: str) -> list[list[str]]:
    """Cells of the page's tables with so many columns and this first title, without their headings."""
    lines = [line.split("|")[1:-1] for line in PAGE.read_text(encoding="utf-8").splitlines()]
    rows = [[cell.strip() for cell in line] for line in lines if len(line) == columns]
    start = next(i for i, row in enumerate(rows) if row[0] == first)
    return rows[start + 2 :]


def test_the_preset_holds_what_its_file_says() -> None:
    data = tomllib.loads((ROOT / "resources/rigs/as-built.toml").read_text(encoding="utf-8"))
    assert data["cable"]["wrap"][0] > 0.5
    assert "inertia" not in data["rig"]["motor"]
    assert data["arms"]["flexion"][1] > 2 * data["arms"]["extension"][1]
    beside = {"capstan_friction", "motor_inertia", "routing_change"}
    assert as_built_page.held_by(load_preset(AS_BUILT)) == {*data["effects"], *beside}
    # A bench whose rig file tells of its rotor, with usual arms and a straight sheath.
    assert as_built_page.held_by(load_preset(PRACTICE)) == {"viscous_friction", "motor_viscous_friction"}


def test_the_sheath_takes_and_gives_by_the_belt_equation() -> None:
    """Euler and Eytelwein: exp(-0.524) = 0.592 of the pull arrives, exp(0.524) = 1.689 of it holds back."""
    words = " ".join(as_built_page.causes(load_preset(AS_BUILT))["capstan_friction"].split())
    assert "41 % of the motor's pull is lost" in words
    assert "holds 69 % more" in words


def test_each_cause_is_taken_away_alone() -> None:
    whole = load_preset(AS_BUILT)
    without = as_built.taken_away(whole)
    assert set(without) == {"", *as_built_page.held_by(whole)} - {"motor_inertia"}
    assert without["contact_angle"].effects.keys() == whole.effects.keys() - {"contact_angle"}
    assert without["capstan_friction"].numbers["cable"]["wrap"] == (0.0, 0.0)
    assert without["capstan_friction"].effects == whole.effects
    assert without["routing_change"].numbers["arms"]["flexion"] == (0.00556, 0.00383)


def test_a_short_session_is_told_step_by_step(tmp_path: Path) -> None:
    path = tmp_path / "bench.h5"
    write_session(path, load_preset(), "rich", shortened(), {"coulomb_friction": {}}, 104)
    row: as_built_page.Row = {
        "seed": 104,
        "protocol": "rich",
        "path": [[None, 5.0], ["coulomb_friction", 1.1]],
    }
    without, with_it = as_built.story(row, path)["steps"]
    assert as_built_page.floors(without, "joint_torque") > 2
    assert as_built_page.floors(with_it, "joint_torque") < 1.5
    assert abs(with_it["share"] - 1) < 0.1  # the friction that was built in explains the peak force
    told = {**row, "verdict": "", "nominal": without, "found": with_it, "steps": [without, with_it]}
    told["thesis_share"] = 0.27
    preset = load_preset(AS_BUILT)
    counted = dict(as_built_page.figures([told, {**row, "failed": "no"}], as_built_page.held_by(preset)))
    assert counted["sheath friction in the path"] == "0 of 2"
    assert counted["nothing in the path that the preset does not hold"] == "1 of 2"
    assert counted["joint torque at most 1.5 floors at the end of the path"] == "1 of 2"
    page = as_built_page.markdown([told], 1, {}, preset, "made so")
    assert "| rich | 104 | 5 → `coulomb_friction` 1.1 | – |" in page
    assert "1. **Coulomb joint friction**: the MCP hinge holds 0.6 mN m" in page


def test_the_figures_of_the_page_count_its_rows() -> None:
    preset_holds, rows = as_built_page.held_by(load_preset(AS_BUILT)), list[dict[str, Any]]()
    for protocol, seed, path, others, *_, share in cells(9, "protocol"):
        names = re.findall(r"`(\w+)`", path)
        assert set(re.findall(r"`(\w+)`", others)) == set(names) - preset_holds
        rows.append({"seed": f"{protocol} {seed}", "path": names, "others": others, "share": share})
    assert len({row["seed"] for row in rows}) == len(rows) > 0
    told = {what: figure for what, figure, *_ in cells(2, "what")}
    held = [row for row in rows if row["path"] and row["others"] == "–"]
    sheath = [row for row in rows if as_built_page.SHEATH in row["path"]]
    assert told["sheath friction in the path"] == f"{len(sheath)} of {len(rows)}"
    assert told["nothing in the path that the preset does not hold"] == f"{len(held)} of {len(rows)}"


def test_the_causes_weigh_what_the_experiment_of_the_thesis_says() -> None:
    """Both pages take the dorsal levers, and then the lean, away from the same bench; each by its own way."""
    words = (ROOT / "docs/replicate.md").read_text(encoding="utf-8")
    levers = re.search(r"levers of the dorsal cable the modelled peak would be (\d+) %", words)
    lean = re.search(r"leans by 40 degrees: without that it would be (\d+) %", words)
    assert levers is not None
    assert lean is not None
    shares = {name.strip("`"): share for name, share, _ in reversed(cells(3, "in the preset"))}
    assert shares["routing_change"] == f"{levers[1]} %"
    assert shares["contact_angle"] == f"{lean[1]} %"
