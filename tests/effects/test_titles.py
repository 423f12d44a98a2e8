"""What the numbers of an effect are called: each name once, so that a sentence can name them all."""

from __future__ import annotations

from fingerlab.diagnosis.answer.candidates import parameter_title
from fingerlab.effects import whole_catalogue


def test_no_two_unknowns_of_an_effect_have_one_title() -> None:
    for effect in whole_catalogue().values():
        titles = [parameter_title(effect, name) for name in (*effect.unknowns, *effect.shape_units)]
        assert len(set(titles)) == len(titles), (effect.id, titles)
