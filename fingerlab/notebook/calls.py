"""What ``import fingerlab`` offers: open, diagnose, fit, simulate, and the catalogue."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from fingerlab.core.errors import UserError
from fingerlab.notebook.catalogue import Catalogue
from fingerlab.notebook.diagnosis import DiagnosisView
from fingerlab.notebook.model import ModelView
from fingerlab.notebook.session import SessionView
from fingerlab.sessions.model import Session
from fingerlab.sessions.reading import open_session

Progress = Callable[[float, str], None]
"""Called with the share done (0 to 1) and what is being done."""
Source = SessionView | Session | str | Path
"""A session: opened, or its file."""


def open(path: str | Path) -> SessionView:
    """Open a session file; samples are read when they are asked for.

    Raises:
        UserError: the file is missing, damaged, or breaks the session format.
    """
    return SessionView(open_session(path))


def opened(source: Source) -> Session:
    """The session behind what a call was given."""
    if isinstance(source, SessionView):
        return source.session
    return source if isinstance(source, Session) else open_session(source)


def diagnose(
    *sessions: Source, added: Sequence[str] = (), curves: bool = True, progress: Progress | None = None
) -> DiagnosisView:
    """Where the model fails on these sessions together, and which effect is missing.

    Args:
        sessions: opened, or files. added: ids of effects that the model holds already.
        curves: whether figures are wanted of it.

    Raises:
        UserError: no session, an unknown effect, or a run that cannot be read.
    """
    from fingerlab.diagnosis import diagnose as run

    read = [opened(one) for one in sessions]
    return DiagnosisView(run(read, _names(added), progress=progress, with_curves=curves), read)


def fit(*sessions: Source, effects: Sequence[str] = (), progress: Progress | None = None) -> ModelView:
    """Fit the nominal model with these effects to the sessions together; it then predicts endpoint force.

    Raises:
        UserError: no session, an unknown effect, one that does not apply, or a run that cannot be read.
    """
    from fingerlab.prediction import fit_extended, model_of_extended

    if not sessions:
        raise UserError("No session was given; name at least one session file.")
    read = [opened(one) for one in sessions]
    return ModelView(model_of_extended(fit_extended(read, _names(effects), progress)))


def load_model(path: str | Path) -> ModelView:
    """Read a model file.

    Raises:
        UserError: the file is missing or no model file.
    """
    from fingerlab.models.file import load_model as load

    return ModelView(load(path), str(path))


def simulate(
    path: str | Path,
    protocol: str = "rich",
    effects: Sequence[str] = (),
    hidden: bool = False,
    seed: int | None = None,
    progress: Progress | None = None,
) -> SessionView:
    """Record a session from the simulated rig into a new file, and open it.

    Args:
        protocol: ``on-air``, ``contact``, ``motor-bench``, ``thesis`` or ``rich``.
        effects: put into the bench, as ``ID`` or ``ID=STRENGTH``.
        hidden: pick an effect (or none) and seal it in the file until ``reveal``.
        seed: same seed, same bench and noise; random for None.

    Raises:
        UserError: the file exists, an unknown protocol or effect, or ``hidden`` with ``effects``.
    """
    from fingerlab.twin.effects import parse_effects
    from fingerlab.twin.preset import load_preset
    from fingerlab.twin.protocols import PROTOCOLS
    from fingerlab.twin.session import new_seed, write_session

    if protocol not in PROTOCOLS:
        raise UserError(f"There is no protocol '{protocol}'; there are {', '.join(PROTOCOLS)}.")
    if hidden and effects:
        raise UserError("hidden=True picks the effect itself; leave out effects, or leave out hidden.")
    chosen = parse_effects(tuple(_names(effects)))
    preset = load_preset()
    plans = PROTOCOLS[protocol](preset.numbers["protocol"]["contact_amplitude_deg"])
    number = new_seed() if seed is None else seed
    write_session(Path(path), preset, protocol, plans, chosen, number, hidden, progress)
    return open(path)


def catalogue() -> Catalogue:
    """The catalogue of effects by id, with those of one's own that have been confirmed."""
    from fingerlab.effects import whole_catalogue

    return Catalogue(whole_catalogue())


def _names(given: Sequence[str]) -> Sequence[str]:
    """A single id is taken as a list of one, and not as a list of its letters."""
    return (given,) if isinstance(given, str) else given
