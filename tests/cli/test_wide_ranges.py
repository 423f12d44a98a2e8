"""A machine that rubs more than its torque and pace let one guess: every command goes on from what was found.

Its guide is greased: 10 N, and 300 N s/m, where half of that is looked for first.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.answer.parameter_explorer import ParameterExplorer
from fingerlab.diagnosis.gram.reduction import Reduction
from fingerlab.sessions import open_session
from tests.cli.calling import call

MASS, COULOMB, VISCOUS, RADIUS = 12.0, 10.0, 300.0, 0.01
"""kg, N, N s/m; m, of the arc as which a line is kept."""
BOTH = ("motor_coulomb_friction", "motor_viscous_friction")


@pytest.fixture(scope="module")
def greased(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs of 8 s of other sums of sines each; noise of 0.3 N."""
    folder, files = tmp_path_factory.mktemp("greased"), list[Path]()
    time = np.arange(0.0, 8.0, 1.0 / 500.0)
    for run, (reach, rate) in enumerate(((0.08, 0.4), (0.05, 0.8), (0.03, 1.2))):
        parts = ((reach, rate), (0.4 * reach, 1.7 * rate), (0.15 * reach, 3.1 * rate))
        each = [(a, 2.0 * np.pi * f, 2.0 * np.pi * f * time + k) for k, (a, f) in enumerate(parts)]
        x = sum(a * np.sin(phase) for a, _, phase in each)
        speed = sum(a * w * np.cos(phase) for a, w, phase in each)
        pull = -sum(a * w**2 * np.sin(phase) for a, w, phase in each)
        force = MASS * pull + COULOMB * np.tanh(speed / 2e-3) + VISCOUS * speed
        force = force + 0.3 * np.random.default_rng(run).standard_normal(len(time))
        files.append(folder / f"{run}.csv")
        table = np.stack((time, 1e3 * x, force), axis=1)
        np.savetxt(files[-1], table, "%.6f", ",", header="time (s),position (mm),force (N)", comments="")
    code, _, err = call("import", "--axis", *files, "--radius", RADIUS, "--out", folder / "greased.h5")
    assert code == 0, err
    return folder / "greased.h5"


def test_what_is_found_does_not_go_by_the_order_in_which_effects_are_added(greased: Path) -> None:
    """Coulomb friction first, the viscous one had stood at its bound, and the rest was a nuisance's."""
    seen = np.concatenate([run.channel("motor_position") for run in open_session(greased).runs])
    for added in (BOTH, BOTH[::-1]):
        said = diagnose([open_session(greased)], added, with_curves=False)
        assert said.verdict == "nothing_missing"
        assert said.score < 1.05
        told = {name: said.parameters[name].value / RADIUS for name in said.parameters}
        assert told["motor_coulomb_friction.coulomb"] == pytest.approx(COULOMB, rel=0.01)
        assert told["motor_viscous_friction.viscous"] / RADIUS == pytest.approx(VISCOUS, rel=0.01)
        # Where to go on: no further than the guide was seen to go.
        assert said.next_experiment is not None
        motion = said.next_experiment["trajectory"]
        for end in (-1.0, 1.0):
            place = np.radians(motion["offset_deg"] + end * motion["amplitude_deg"])
            assert min(seen) - 2e-4 < place < max(seen) + 2e-4


def test_a_saved_model_is_compared_as_it_was_found(greased: Path, tmp_path: Path) -> None:
    """It left 157 floors in the comparison: its viscous friction was cut to what is usual."""
    saved, compared = tmp_path / "model.json", tmp_path / "compared.json"
    assert call("diagnose", greased, *(w for one in BOTH for w in ("--add", one)), "--save", saved)[0] == 0
    assert call("compare", greased, "--model", saved, "--json", compared)[0] == 0
    rows = {one["model"]: one for one in json.loads(compared.read_text(encoding="utf-8"))["models"]}
    assert rows["model.json"]["score"] < 1.05
    assert rows["nominal model"]["score"] > 100.0


def test_a_value_that_was_found_can_be_held_and_moved(greased: Path) -> None:
    value = VISCOUS * RADIUS**2
    kept = Reduction([open_session(greased)])
    options = DiagnosisOptions(held={"motor_viscous_friction.viscous": value}, kept=kept)
    said = diagnose([open_session(greased)], BOTH, with_curves=False, options=options)
    assert said.parameters["motor_viscous_friction.viscous"].value == pytest.approx(value)
    assert said.score < 1.05
    listed = {one.key: one for one in ParameterExplorer(kept, said).parameters}
    viscous = listed["motor_viscous_friction.viscous"]
    assert viscous.low <= value < viscous.high
    # Of the law with the square of the speed, which the model does not hold, nothing is listed.
    assert "motor_viscous_friction.turbulent" not in listed
