"""Reading shared with a second process, and grid points chosen without a fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fingerlab.cli.main import cli
from fingerlab.core import progress
from fingerlab.core.errors import UserError
from fingerlab.diagnosis import DiagnosisOptions, diagnose
from fingerlab.diagnosis.equations.model import Choice
from fingerlab.diagnosis.score.scorer import Scorer
from fingerlab.diagnosis.search.next_effect import ScoreTest
from fingerlab.effects import CATALOGUE
from fingerlab.sessions import copy_session, open_session
from tests.reduced import reduce_sessions

REDUCTION = "fingerlab.diagnosis.gram.reduction"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("shared") / "s.h5"
    recorded = CliRunner().invoke(
        cli,
        [
            "simulate",
            "--protocol",
            "on-air",
            "--effect",
            "motor_coulomb_friction",
            "--seed",
            "4",
            "--out",
            str(path),
        ],
    )
    assert recorded.exit_code == 0
    return path


def test_two_processes_give_what_one_gives_to_the_last_bit(
    recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "WORTH_BYTES", 0)
    alone = diagnose([open_session(recorded)], with_curves=False)
    with progress.second_process([recorded], REDUCTION) as executor:
        assert executor is not None
        shared = diagnose(
            [open_session(recorded)], with_curves=False, options=DiagnosisOptions(executor=executor)
        )
    assert [(c.effect, c.score, c.probability) for c in shared.candidates] == [
        (c.effect, c.score, c.probability) for c in alone.candidates
    ]
    assert shared.score == alone.score


def test_a_fault_that_the_second_process_meets_is_told_in_one_sentence(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import h5py

    broken = tmp_path / "broken.h5"
    copy_session(recorded, broken)
    with h5py.File(broken, "r+") as file:
        for run in list(file["runs"])[1:]:
            file["runs"][run]["mcp_angle"][5000] = np.nan
    monkeypatch.setattr(progress, "WORTH_BYTES", 0)
    with (
        progress.second_process([broken], REDUCTION) as executor,
        pytest.raises(UserError, match="mcp_angle"),
    ):
        diagnose([open_session(broken)], with_curves=False, options=DiagnosisOptions(executor=executor))


def test_small_files_start_no_second_process(recorded: Path) -> None:
    small = recorded.with_name("small.txt")
    small.write_text("nothing to read")
    with progress.second_process([small], REDUCTION) as executor:
        assert executor is None


def test_the_score_test_chooses_grid_points_as_whole_fits_do(recorded: Path) -> None:
    """A fit of every grid point is the judge: the test's point must reach nine tenths of the best fall."""
    names = ("coulomb_friction", "motor_coulomb_friction", "motor_presliding", "torque_ripple")
    effects = [CATALOGUE[name] for name in names]
    scorer = Scorer(reduce_sessions([open_session(recorded)], effects))
    base = scorer.fit_reweighted([])
    test = ScoreTest(scorer.data, base)
    for effect in effects:
        costs = [scorer.fit([Choice(effect, i)], base, 12).fit.cost for i in range(len(effect.shapes))]
        fall = base.fit.cost - np.array(costs)
        assert fall[test.best_point(effect).shape] >= 0.9 * fall.max()


def test_effects_of_contact_are_no_candidates_where_nothing_is_touched(recorded: Path) -> None:
    ids = {c.effect for c in diagnose([open_session(recorded)], with_curves=False).candidates}
    assert ids.isdisjoint({"contact_angle", "load_cell_gain"})
    assert "coulomb_friction" in ids
