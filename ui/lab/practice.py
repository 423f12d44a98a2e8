"""Practice on a hidden effect: a session from the simulated rig, sealed until it is revealed. No Qt.

The instrument's modules are imported in the worker: the twin's compiler is slow to load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from fingerlab.core.errors import Cancelled
from fingerlab.core.files import own_data
from fingerlab.core.text import estimate_text
from fingerlab.models.file import ParameterEstimate
from fingerlab.sessions.model import Session

from ..app.worker import IsCancelled, Progress

if TYPE_CHECKING:
    from ..app.context import ApplicationContext

PROTOCOL = "rich"
TITLE = "Recording a practice session"
EXAMPLE_TITLE = "Recording the example"
EXAMPLES: dict[str, tuple[str, tuple[str, ...]]] = {
    "joint-friction": ("friction in the joints", ("coulomb_friction",)),
    "slack-cable": ("a cable that hangs loose", ("cable_slack",)),
    "nothing-missing": ("nothing is missing", ()),
}
"""Sessions of the simulated rig to look at first: name of the file, title, effects that it has."""
EXAMPLE_SEED = 11


def simulate(progress: Progress, cancelled: IsCancelled, example: str = "") -> Path:
    """Record a session with a sealed effect, or one of the ``EXAMPLES``; returns its file.

    Raises:
        UserError: the folder cannot be written to.
        Cancelled: the user stopped it; nothing is left behind.
    """
    progress(0.0, "preparing the simulated rig")
    from fingerlab.twin.effects import parse_effects
    from fingerlab.twin.protocols import PROTOCOLS, load_preset
    from fingerlab.twin.session import new_seed, write_session

    folder = own_data("practice")
    folder.mkdir(parents=True, exist_ok=True)
    name = f"example-{example}" if example else f"practice-{datetime.now():%Y-%m-%d-%H%M%S}"
    path = folder / f"{name}.h5"
    if example and path.exists():
        return path
    effects = parse_effects(EXAMPLES[example][1]) if example else {}
    seed = EXAMPLE_SEED if example else new_seed()
    preset = load_preset()
    plans = PROTOCOLS[PROTOCOL](preset.numbers["protocol"]["contact_amplitude_deg"])

    def report(share: float, what: str) -> None:
        if cancelled():
            raise Cancelled
        progress(share, what)

    write_session(path, preset, PROTOCOL, plans, effects, seed, practice=not example, progress=report)
    return path


def start(context: ApplicationContext) -> None:
    """Simulate a session with a sealed effect and open it in the Model lab, which is shown at once."""
    context.hush()
    context.show_tab("model_lab")
    context.tasks.start(TITLE, simulate, lambda path: context.open_paths([path]))


def show_example(context: ApplicationContext, name: str) -> None:
    """Open one of the ``EXAMPLES`` in the Model lab; it is recorded when it is asked for the first time."""
    context.hush()
    context.show_tab("model_lab")
    title = f"{EXAMPLE_TITLE}: {EXAMPLES[name][0]}"
    context.tasks.start(
        title,
        lambda progress, cancelled: simulate(progress, cancelled, name),
        lambda path: context.open_paths([path]),
    )


def is_sealed(session: Session) -> bool:
    """Whether the session holds an effect that was not told."""
    return "sealed" in session.attributes


def reveal(
    session: Session, model: Sequence[str], fitted: Mapping[str, ParameterEstimate] | None = None
) -> str:
    """What the session holds, whether the effects in ``model`` name it, and what to do next.

    Args:
        fitted: parameters of that model, an effect's own as ``effect.gain``, told beside what was hidden.

    Raises:
        UserError: the session is not a simulated one, or its seal is damaged.
    """
    from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed
    from fingerlab.twin.session import reveal_session

    effects = reveal_session(session.path)["effects"]
    hidden = set(effects)
    if not effects:
        answer = "Nothing was hidden: the bench has noise and tolerances and no missing effect."
    else:
        words = "; ".join(_effect_words(name, values, fitted or {}) for name, values in effects.items())
        answer = f"Hidden was: {words}."
    if hidden == set(model):
        return f"{answer} Your guess was right: your model has just that. {NEXT}"
    named = listed([in_sentence(effect_title(name)) for name in effects if name not in model])
    then = f"Add {named} and see the error fall." if named else f"Undo takes the rest out again. {NEXT}"
    if not model:
        return f"{answer} You have made no guess: nothing was added to the model. {then}"
    right = "right in part" if hidden & set(model) else "another"
    has = listed([in_sentence(effect_title(name)) for name in model])
    return f"{answer} Your guess was {right}: your model has {has}. {then}"


NEXT = "Next: practise on another, or open recordings of your own."


def answer_words(session: Session) -> str:
    """What a revealed session holds, in a few words: ``Hidden was: Coulomb joint friction``.

    Raises:
        UserError: as :func:`reveal`.
    """
    from fingerlab.report.diagnosis_words import effect_title, in_sentence, listed

    names = [in_sentence(effect_title(name)) for name in hidden_effects(session)]
    return f"Hidden was: {listed(names)}" if names else "Nothing was hidden"


def hidden_effects(session: Session) -> tuple[str, ...]:
    """Ids of the effects that a simulated session holds.

    Raises:
        UserError: as :func:`reveal`.
    """
    from fingerlab.twin.session import reveal_session

    return tuple(reveal_session(session.path)["effects"])


Hidden = Mapping[str, float]
"""An effect's constants in the simulator."""


def _effect_words(name: str, values: Hidden, fitted: Mapping[str, ParameterEstimate]) -> str:
    """An effect with its constants, by the names that the fit has for them if any, and what was fitted."""
    from fingerlab.report.diagnosis_words import effect_title, in_sentence
    from fingerlab.report.parameter_words import parameter_titles
    from fingerlab.twin.effects import EFFECTS

    plant = EFFECTS.get(name)
    units = {} if plant is None else {p.name: p.unit for p in plant.parameters}
    if plant is not None and plant.expected is not None and units.keys() <= values.keys():
        values, units = plant.expected(values), _fitted_units(name)
    titles = parameter_titles(name, list(values))
    numbers = []
    for key, value in values.items():
        words = f"{titles[key]} {estimate_text(ParameterEstimate(value, units.get(key, ''), value, value))}"
        found = fitted.get(f"{name}.{key}")
        numbers.append(f"{words}, fitted {estimate_text(found)}" if found is not None else words)
    title = in_sentence(effect_title(name))
    return f"{title} ({'; '.join(numbers)})" if numbers else title


def _fitted_units(name: str) -> dict[str, str]:
    from fingerlab.effects import find_effect

    one = find_effect(name)
    return {} if one is None else {gain: parameter.unit for gain, parameter in one.unknowns.items()}
