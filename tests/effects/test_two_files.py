"""An effect is two files: all that lists effects has a made-up one that is put into a copy of the program."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fingerlab.effects import CATALOGUE

ROOT = Path(__file__).parents[2]
LAW = '''"""A seal that drags in proportion to the motor's speed."""

from __future__ import annotations

from fingerlab.effects.base import Effect, Formula, Row, Shape, Term
from fingerlab.effects.base import Example
from fingerlab.effects.transmission import drive_terms
from fingerlab.physics.motion import Motion
from fingerlab.physics.parameter import Parameter


def columns(motion: Motion, shape: Shape) -> list[Term]:
    return drive_terms(motion, "drag", motion.velocity)


EFFECT = Effect(
    id="seal_drag",
    title="Seal that drags",
    family="Motor and gearbox",
    acts_on=("motor_torque",),
    gains={"drag": Parameter("N m s/rad", 0.0, 0.05, 2e-3, title="drag of the seal")},
    columns=columns,
    coordinate="motor speed",
    equation=Row.PIP,
    explanation="Both joints miss the same tension, as if a seal dragged.",
    reveal="a motor-bench run with and without the seal",
    bench=True,
    formula=Formula(
        equation=r"\\tau_m = S\\,\\dot\\theta_m",
        symbols="S: drag of the seal.",
        source="Made up.",
        values={"drag": "S"},
        alike=("motor_viscous_friction",),
    ),
    example=Example({}, {"velocity": 3.0}, {"MCP drag": 300.0}),
)
'''
CHANGE = '''"""A seal on the output shaft."""

from __future__ import annotations

from fingerlab.twin.plant import DRIVE, Plant, PlantEffect, Values, constant


def apply(bench: Plant, v: Values) -> None:
    bench.plant["motor_viscous"] += v["drag"]


EFFECT = PlantEffect("seal_drag", (constant("drag", "N m s/rad", 6e-3, 1e-3, 2e-2),), DRIVE, apply)
'''
SWING = json.dumps(
    {"kind": "sine", "amplitude_deg": 50.0, "offset_deg": 60.0, "frequency_hz": 0.8, "duration_s": 8.0}
)
LISTED = """
import json
from fingerlab.effects import CATALOGUE
from fingerlab.twin.effects import EFFECTS
from fingerlab.ui.acquire.bench_setup import effect_choices
from tests.hidden.sweep.__main__ import trials
from tests.hidden.sweep.table import near
blind = trials({"rich", "pairs", "outside"}, list(EFFECTS), [101])
print(json.dumps({
    "catalogue": list(CATALOGUE), "bench": list(EFFECTS), "window": dict(effect_choices()),
    "sweep": sorted({name for trial in blind for name in trial.effects}),
    "near": [name for name in EFFECTS if near("seal_drag", name)],
}))
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the program, its documents and the blind trials; compiled code comes along."""
    folder = tmp_path_factory.mktemp("program")
    shutil.copytree(ROOT / "fingerlab", folder / "fingerlab")
    for part in ("ui", "resources"):
        shutil.copytree(ROOT / part, folder / "fingerlab" / part)
    shutil.copytree(ROOT / "docs", folder / "docs", ignore=shutil.ignore_patterns("images"))
    shutil.copytree(ROOT / "tests" / "hidden", folder / "tests" / "hidden")
    (folder / "fingerlab" / "effects" / "seal_drag.py").write_text(LAW, encoding="utf-8")
    (folder / "fingerlab" / "twin" / "effects" / "seal_drag.py").write_text(CHANGE, encoding="utf-8")
    return folder


def python(copy: Path, *arguments: str) -> str:
    """What the copy prints."""
    environment = {**os.environ, "PYTHONPATH": str(copy), "QT_QPA_PLATFORM": "offscreen"}
    environment["FINGERLAB_SETTINGS_DIR"] = str(copy / "settings")
    done = subprocess.run(
        [sys.executable, *arguments], cwd=copy, env=environment, capture_output=True, text=True,
        encoding="utf-8", check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


ONE_AFTER_THE_OTHER = """
import contextlib, io, json, sys
from fingerlab.cli.main import main
told = []
for line in json.loads(sys.argv[1]):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            main(line)
        except SystemExit as end:
            assert not end.code, line
    told.append(out.getvalue())
print(json.dumps(told))
"""


def fingerlab(copy: Path, *lines: tuple[str, ...]) -> list[str]:
    """What each command prints; they share one process, for libraries take a second to import."""
    told: list[str] = json.loads(python(copy, "-c", ONE_AFTER_THE_OTHER, json.dumps(lines)))
    return told


def test_lists_of_the_program_the_window_and_the_blind_trials_have_it(copy: Path) -> None:
    told = json.loads(python(copy, "-c", LISTED))
    assert told["catalogue"][-1] == told["bench"][-1] == "seal_drag"
    assert len(told["catalogue"]) == len(told["bench"]) == 34
    assert told["window"]["seal_drag"] == "Seal that drags"
    assert "seal_drag" in told["sweep"]
    assert told["near"] == ["motor_viscous_friction"]


def test_the_command_line_has_it(copy: Path) -> None:
    as_json, as_words = fingerlab(copy, ("effects", "--json", "-"), ("effects",))
    (one,) = [e for e in json.loads(as_json)["effects"] if e["id"] == "seal_drag"]
    assert one["parameters"]["drag"]["high"] == 0.05
    assert not one["own"]
    assert "34 effects, 0 of them your own." in as_words


def test_the_documents_have_its_page_and_its_picture(copy: Path) -> None:
    python(copy, "docs/generate.py", "pages")
    index = (copy / "pages" / "catalogue" / "index.md").read_text(encoding="utf-8")
    assert index.index("## Motor and gearbox") < index.index("`seal_drag`") < index.index("## Sensors")
    page = (copy / "pages" / "catalogue" / "seal_drag.md").read_text(encoding="utf-8")
    for part in (
        r"\tau_m = S\,\dot\theta_m",
        "Source: Made up.",
        'class="course"',
        "motor_viscous_friction.md",
    ):
        assert part in page


def test_it_is_put_in_found_again_and_printed_with_its_equation(copy: Path) -> None:
    run = ("--trajectory", SWING, "--phase", "motor_bench", "--seed", "3", "--out", "seal.h5")
    written = ("--out", "seal.html", "--equation", "seal.md")
    _, revealed, diagnosed, _ = fingerlab(
        copy,
        ("simulate", "--effect", "seal_drag", *run),
        ("reveal", "seal.h5"),
        ("diagnose", "seal.h5", "--json", "-"),
        ("report", "seal.h5", "--add", "seal_drag", *written),
    )
    assert revealed.startswith("seal_drag: drag = 0.006 N m s/rad")
    found = json.loads(diagnosed)
    (one,) = [c for c in found["candidates"] if c["effect"] == "seal_drag"]
    assert one["in_set"]
    assert "seal_drag" in found["set"]
    equation = (copy / "seal.md").read_text(encoding="utf-8")
    assert r"\tau_m &= S\,\dot\theta_m" in equation
    value = equation.split("| $S$ | Drag of the seal | $")[1].split(r" \pm")[0]
    assert float(value) == pytest.approx(6e-3, rel=0.05)  # what was put in


OTHER = {
    "fingerlab/rig/file.py": {"added_mass"},  # a change of the rig that a run tells
    "ui/lab/practice.py": {"coulomb_friction", "cable_slack"},  # which examples there are
}
"""Names that are no knowledge of an effect."""


def sources() -> Iterator[tuple[str, ast.Module]]:
    """Every file of the program but the effects' and the simulator's, by its place in the repository."""
    for part in ("fingerlab", "ui"):
        for path in sorted((ROOT / part).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if not name.startswith(("fingerlab/effects/", "fingerlab/twin/", "fingerlab/ui/")):
                yield name, ast.parse(path.read_text(encoding="utf-8"))


def test_no_effect_is_named_outside_of_its_files() -> None:
    named = {
        (name, node.value.partition(".")[0])
        for name, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if node.value.partition(".")[0] in CATALOGUE
    }
    assert named == {(name, effect) for name, effects in OTHER.items() for effect in effects}
