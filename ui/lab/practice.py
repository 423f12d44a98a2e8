"""Practice on a hidden effect: a session from the simulated rig, sealed until it is revealed. No Qt.

The instrument's modules are imported in the worker: the twin's compiler is slow to load.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from fingerlab.core.errors import Cancelled
from fingerlab.core.text import estimate_text
from fingerlab.models.file import ParameterEstimate
from fingerlab.sessions.model import Session

from ..app.worker import IsCancelled, Progress

if TYPE_CHECKING:
    from ..app.context import ApplicationContext

PROTOCOL = "rich"
TITLE = "Recording a practice session"


def practice_folder() -> Path:
    """Where practice sessions are kept: the user's own data folder."""
    from platformdirs import user_data_path

    return user_data_path("FingerLab", appauthor=False) / "practice"


def simulate(progress: Progress, cancelled: IsCancelled) -> Path:
    """Record a session with a sealed effect; returns its file.

    Raises:
        UserError: the folder cannot be written to.
        Cancelled: the user stopped it; nothing is left behind.
    """
    progress(0.0, "preparing the simulated rig")
    from fingerlab.twin.preset import load_preset
    from fingerlab.twin.protocols import PROTOCOLS
    from fingerlab.twin.session import new_seed, write_session

    folder = practice_folder()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"practice-{datetime.now():%Y-%m-%d-%H%M%S}.h5"
    preset = load_preset()
    plans = PROTOCOLS[PROTOCOL](preset.numbers["protocol"]["contact_amplitude_deg"])

    def report(share: float, what: str) -> None:
        if cancelled():
            raise Cancelled
        progress(share, what)

    write_session(path, preset, PROTOCOL, plans, {}, new_seed(), practice=True, progress=report)
    return path


def start(context: ApplicationContext) -> None:
    """Simulate a session with a sealed effect and open it in the Model lab, which is shown at once."""
    context.hush()
    context.show_tab("model_lab")
    context.tasks.start(TITLE, simulate, lambda path: context.open_paths([path]))


def is_sealed(session: Session) -> bool:
    """Whether the session holds an effect that was not told."""
    return "sealed" in session.attributes


def reveal(session: Session, model: Sequence[str]) -> str:
    """What the session holds, and whether the effects in ``model`` name it.

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
        answer = "Hidden was: " + "; ".join(_told(name, values) for name, values in effects.items()) + "."
    if hidden == set(model):
        return f"{answer} Your guess was right: your model has just that."
    if not model:
        return f"{answer} You have made no guess: nothing was added to the model."
    right = "right in part" if hidden & set(model) else "another"
    has = listed([in_sentence(effect_title(name)) for name in model])
    return f"{answer} Your guess was {right}: your model has {has}."


def hidden_effects(session: Session) -> tuple[str, ...]:
    """Ids of the effects that a simulated session holds.

    Raises:
        UserError: as :func:`reveal`.
    """
    from fingerlab.twin.session import reveal_session

    return tuple(reveal_session(session.path)["effects"])


def _told(name: str, values: dict[str, float]) -> str:
    from fingerlab.report.diagnosis_words import effect_title, in_sentence, parameter_titles
    from fingerlab.twin.effects import EFFECTS

    units = {p.name: p.unit for p in EFFECTS[name].parameters} if name in EFFECTS else {}
    titles = parameter_titles(name, list(values))
    numbers = [
        f"{titles[key]} {estimate_text(ParameterEstimate(value, units.get(key, ''), value, value))}"
        for key, value in values.items()
    ]
    title = in_sentence(effect_title(name))
    return f"{title} ({', '.join(numbers)})" if numbers else title
