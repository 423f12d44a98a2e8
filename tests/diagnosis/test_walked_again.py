"""What follows the first effect: nothing where a second look at it leaves little.

A way of several effects whose end leaves much is walked again from its likeliest effect.
"""

from __future__ import annotations

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import pytest

asked = import_module("fingerlab.diagnosis.diagnose")  # the package has the function by that name
COUNT = 1000.0


def trial(*effects: str, left: float = 1.0) -> Any:
    choices = tuple(SimpleNamespace(effect=SimpleNamespace(id=name), shape=0) for name in effects)
    return SimpleNamespace(model=SimpleNamespace(choices=choices), misfit=left * COUNT, count=COUNT)


QUESTION: Any = SimpleNamespace(
    catalogue=(), reduction=SimpleNamespace(sessions=()), scale=SimpleNamespace(part=lambda low, high: None)
)
BEST = trial("presliding_hysteresis")
RIGHT = trial("presliding_hysteresis", "stiffness_error", left=0.2)


def walked(path: list[Any], monkeypatch: pytest.MonkeyPatch, dense: float, best: Any = BEST) -> list[str]:
    """Effects of the path that is kept, where the other one has the density ``dense`` and it has 100."""

    def beyond(_: Any, __: Any, first: list[Any], *___: Any) -> tuple[str, list[Any]]:
        assert [c.effect.id for c in first[-1].model.choices] == ["presliding_hysteresis"]
        return "another study", [trial(), BEST, RIGHT]

    monkeypatch.setattr(asked, "look_again_along", lambda _, steps, *__: ("study", steps))
    monkeypatch.setattr(asked, "look_beyond", beyond)
    monkeypatch.setattr(asked, "density", lambda _, one: dense if one is RIGHT else 100.0)
    kept = asked._walked_again(QUESTION, best, "closer study", path)  # type: ignore[arg-type]
    return [c.effect.id for c in kept[1][-1].model.choices]


def path_of(*effects: str, left: float = 0.6) -> list[Any]:
    return [*(trial(*effects[:k]) for k in range(len(effects))), trial(*effects, left=left)]


TAKEN = "torque_ripple", "presliding_hysteresis"


def test_the_likelier_way_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    assert walked(path_of(*TAKEN), monkeypatch, 99.0) == ["presliding_hysteresis", "stiffness_error"]
    assert walked(path_of(*TAKEN), monkeypatch, 101.0) == [*TAKEN]


@pytest.mark.parametrize(
    ("path", "best"),
    [
        (path_of(*TAKEN, left=0.39), BEST),  # nearly right
        (path_of("presliding_hysteresis"), BEST),  # one effect alone
        (path_of("torque_ripple", "stiffness_error"), BEST),  # the best stood for two others
    ],
)
def test_another_way_is_not_looked_for(path: list[Any], best: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = [c.effect.id for c in path[-1].model.choices]
    assert walked(path, monkeypatch, 0.0, best) == kept


def test_where_the_second_look_finds_no_further_effect_the_way_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    path = path_of(*TAKEN)
    monkeypatch.setattr(asked, "look_again_along", lambda _, steps, *__: ("study", steps))
    monkeypatch.setattr(asked, "look_beyond", lambda *_: None)
    assert asked._walked_again(QUESTION, BEST, "closer study", path)[1] is path  # type: ignore[arg-type]


@pytest.mark.parametrize(("left", "searches"), [(0.1, [1]), (0.3, [1, 4])])
def test_no_further_effect_is_sought_where_the_first_leaves_little_at_a_second_look(
    left: float, searches: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A further effect must lower the squared score by 0.2."""
    asked_for: list[int] = []

    def forward(*_: Any, most: int = 4) -> list[Any]:
        asked_for.append(most)
        return [trial(), trial("capstan_friction", left=1.5)]

    seen = [trial(), trial("capstan_friction", left=left)]
    monkeypatch.setattr(asked, "forward", forward)
    monkeypatch.setattr(asked, "worth_a_look", lambda _: True)
    monkeypatch.setattr(asked, "look_again_along", lambda *_: ("closer study", seen))
    monkeypatch.setattr(asked, "_verdict", lambda _: "nothing_missing")  # no rivals are looked at
    layout = SimpleNamespace(layout=SimpleNamespace(effects=()))
    study: Any = SimpleNamespace(weights="first", reduced=layout)
    question: Any = SimpleNamespace(**vars(QUESTION), given=())
    _, path, look = asked._way(question, study, SimpleNamespace())  # type: ignore[arg-type]
    assert asked_for == searches
    assert look.path is seen  # kept: it is not looked at twice
    monkeypatch.setattr(asked, "look_again_along", lambda *_: pytest.fail("looked at again"))
    assert asked._looked_at_again(question, path, look) == ("closer study", seen)


def test_a_first_step_that_only_a_later_one_bears_out_is_sought_with_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    both = path_of("motor_inertia", "stribeck_friction")
    monkeypatch.setattr(asked, "forward", lambda *_, most=4: [trial()] if most == 1 else both)
    monkeypatch.setattr(asked, "worth_a_look", lambda _: True)
    monkeypatch.setattr(asked, "_verdict", lambda _: "missing_effect")
    layout = SimpleNamespace(layout=SimpleNamespace(effects=()))
    study: Any = SimpleNamespace(weights="first", reduced=layout)
    question: Any = SimpleNamespace(**vars(QUESTION), given=())
    assert asked._way(question, study, SimpleNamespace())[1:] == (both, None)  # type: ignore[arg-type]
