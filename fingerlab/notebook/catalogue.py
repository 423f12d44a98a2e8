"""The catalogue of effects, as a notebook shows it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fingerlab.notebook.layout import Part, Shown, Table
from fingerlab.physics.effects.base import Effect


class Catalogue(Mapping[str, Effect], Shown):
    """Effects by id, one's own included."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = dict(effects)

    def __getitem__(self, effect: str) -> Effect:
        return self._effects[effect]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def _parts(self) -> Sequence[Part]:
        from fingerlab.report.diagnosis_words import FAMILY_TITLES, listed

        rows = [
            (one.id, one.title, listed([FAMILY_TITLES.get(e, e).lower() for e in one.acts_on]))
            for one in self.values()
        ]
        return (f"{len(self)} effects", Table(("id", "effect", "acts on"), rows))
