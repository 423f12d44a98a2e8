"""What is seen of a drafted law: what the model misses without it, and what the law tells of that."""

from __future__ import annotations

from fingerlab.diagnosis.answer.curves import Display
from fingerlab.diagnosis.answer.results import Fingerprint
from fingerlab.diagnosis.draft.search import Law
from fingerlab.diagnosis.gram.reduction import Reduction


def seen_and_drafted(reduction: Reduction, law: Law) -> Fingerprint | None:
    """The remainder binned over what the law's first term is seen against, and the whole law's own curve.

    Raises:
        UserError: a run cannot be read. Cancelled: the user asked for it.
    """
    display = Display()
    reduced = law.scorer.reduced
    reduction.shown(reduced.layout.effects, display.keep)
    first = law.fitted.choices[len(law.base.choices)].effect
    return display.fingerprint_between(reduced, first, law.base, law.fitted)
