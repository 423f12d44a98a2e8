"""The catalogue of effects, as a notebook shows it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from fingerlab.effects.base import Effect
from fingerlab.notebook.layout import Part, Shown, Table


class EffectView(Shown):
    """One effect. ``effect`` is the object behind it (``fingerlab.effects.Effect``)."""

    def __init__(self, effect: Effect) -> None:
        self.effect = effect

    @property
    def id(self) -> str:
        """What ``added`` and ``--add`` call it."""
        return self.effect.id

    @property
    def title(self) -> str:
        """What the screen calls it."""
        return self.effect.title

    def _parts(self) -> Sequence[Part]:
        from fingerlab.report.diagnosis_words import FAMILY_TITLES, listed

        one = self.effect
        changes = listed([FAMILY_TITLES.get(e, e).lower() for e in one.acts_on])
        rows = [
            (name, gain.title or name, gain.unit, f"{gain.low:g} to {gain.high:g}", gain.source)
            for name, gain in one.unknowns.items()
        ]
        parts: list[Part] = [f"{one.title} ({one.id}), changes {changes}", one.explanation]
        if rows:
            parts.append(Table(("unknown", "what", "unit", "plausible range", "source"), rows))
        return (*parts, f"What reveals it: {one.reveal}.")


class Catalogue(Mapping[str, EffectView], Shown):
    """Effects by id, one's own included."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = {name: EffectView(one) for name, one in effects.items()}

    def __getitem__(self, effect: str) -> EffectView:
        return self._effects[effect]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def _parts(self) -> Sequence[Part]:
        from fingerlab.report.diagnosis_words import FAMILY_TITLES, listed

        rows = [
            (one.id, one.title, listed([FAMILY_TITLES.get(e, e).lower() for e in one.acts_on]))
            for one in (view.effect for view in self.values())
        ]
        return (f"{len(self)} effects", Table(("id", "effect", "acts on"), rows))
