"""Effects that are alike on their grids: what leaves less at its refined shape is named."""

from __future__ import annotations

import numpy as np
import pytest

from fingerlab.diagnosis.score.evidence import Evidence, judge
from fingerlab.diagnosis.search.ties import ties_to_refine, with_refined_odds

from .invented import leaving

PAIR = "load_dependent_friction", "capstan_friction"
BEFORE = 60.0


def tied(left: float, names: tuple[str, str] = PAIR, before: float = BEFORE) -> Evidence:
    """Two effects that leave the same on their grids, to a thousandth."""
    return judge(leaving(before), [leaving(left, names[0]), leaving(1.001 * left, names[1])])


def test_the_one_that_leaves_less_between_its_points_is_named() -> None:
    evidence = tied(17.0)
    assert sorted(ties_to_refine(evidence)) == [0, 1]
    after = with_refined_odds(evidence, [0, 1], [leaving(16.0, PAIR[0]), leaving(3.0, PAIR[1])])
    # Beyond the usual 0.14, to the power of half of sixteen values. A run sees two unknowns of either, and
    # each takes a thousandth of the fall. The second has a share for each cable; one more costs half a nat.
    left = [misfit + 2 * 0.001 * (BEFORE - misfit) for misfit in (16.0, 3.0)]
    odds = ((left[0] + 0.1 - 0.14) / (left[1] + 0.1 - 0.14)) ** 8 * np.exp(-0.5)
    shares = after.probabilities
    assert shares[1] / shares[0] == pytest.approx(odds, rel=0.02)
    assert shares.sum() == pytest.approx(evidence.probabilities.sum())


def test_alike_they_stay_alike() -> None:
    evidence = tied(6.0)
    after = with_refined_odds(evidence, [0, 1], [leaving(5.0, PAIR[0]), leaving(5.0, PAIR[1])])
    assert after.log_odds == pytest.approx(evidence.log_odds, abs=0.02)


def test_what_explains_nearly_as_much_as_the_best_is_looked_at_whatever_the_best_leaves() -> None:
    assert ties_to_refine(tied(0.15, before=3.0))
    assert ties_to_refine(tied(0.0, before=3.0))
    # With a tenth more of all that is missed it is far behind: its grid is not that coarse.
    far = judge(leaving(BEFORE), [leaving(0.1, PAIR[0]), leaving(0.1 * BEFORE, PAIR[1])])
    assert not ties_to_refine(far)


def test_effects_without_other_shapes_are_not_looked_at() -> None:
    assert not ties_to_refine(tied(6.0, ("viscous_friction", "motor_viscous_friction")))


def test_one_alone_is_not_looked_at() -> None:
    assert not ties_to_refine(judge(leaving(BEFORE), [leaving(3.0, PAIR[1]), leaving(40.0, PAIR[0])]))
