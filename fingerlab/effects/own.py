"""A user's own effects: each a small Python file in a folder that they chose.

A file runs only after its user has confirmed exactly this content, here by :func:`trust`; an unconfirmed or
changed one is read, and never run. It defines ``EFFECT = Effect(...)`` or ``EFFECTS = [...]`` with the
same :class:`~fingerlab.effects.base.Effect` as the built-in catalogue.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock

from fingerlab.core.errors import UserError
from fingerlab.core.trust import (
    OwnSettings,
    OwnSource,
    State,
    confirm,
    confirmed_names,
    forget_file,
    read_settings,
    run_source,
    told,
    with_state,
    write_settings,
)
from fingerlab.effects.base import Effect
from fingerlab.effects.own_checks import checked


@dataclass(frozen=True)
class OwnFile:
    """A file of the folder and what became of it.

    ``effects`` is empty unless it is trusted and good; ``problem`` says what is wrong with a trusted one.
    """

    source: OwnSource
    effects: tuple[Effect, ...] = ()
    problem: str = ""

    @property
    def state(self) -> State:
        return self.source.state

    @property
    def notice(self) -> str:
        """One sentence for whoever starts a diagnosis; empty where there is nothing to say."""
        if self.state == "trusted":
            return f"An effect of your own is left out: {self.problem}" if self.problem else ""
        why = "was changed since you confirmed it" if self.state == "changed" else "is new"
        return (
            f"The effect file {self.source.file} {why} and is not run; it waits for "
            f"'fingerlab effects --trust {Path(self.source.file).name}'."
        )


def own_files(taken: Collection[str]) -> tuple[OwnFile, ...]:
    """Every Python file of the chosen folder, by name; the trusted ones are run and checked.

    Args:
        taken: ids of the built-in catalogue, which no effect of a user may have.

    Raises:
        UserError: the settings are damaged.
    """
    fixed = _FIXED.get()
    if fixed is None:
        settings = read_settings()
        sources = [with_state(source, settings) for source in _sources(settings.folder)]
    else:
        sources = [replace(source, state="trusted") for source in fixed]
    result = []
    owners: dict[str, str] = dict.fromkeys(taken, "the built-in catalogue")
    for source in sources:
        file = _loaded(source) if source.state == "trusted" else OwnFile(source)
        file = _without_taken(file, owners)
        owners |= {effect.id: source.file for effect in file.effects}
        result.append(file)
    return tuple(result)


def notices(taken: Collection[str]) -> tuple[str, ...]:
    """A sentence on each file that waits to be confirmed or does not work; see :func:`own_files`."""
    return tuple(file.notice for file in own_files(taken) if file.notice)


def set_folder(folder: Path) -> Path:
    """Remember the folder in which own effects are looked for; nothing in it is run by that.

    Raises:
        UserError: there is no such folder.
    """
    if not folder.is_dir():
        raise UserError(f"{folder} is not a folder; give the folder that holds your own effects.")
    folder = folder.resolve()
    write_settings(replace(read_settings(), folder=folder))
    return folder


def forget() -> None:
    """Forget the folder and every confirmation."""
    write_settings(OwnSettings())


def distrust(name: Path) -> str:
    """Forget that a file was confirmed, whether it is still in the folder or not; its name.

    Args:
        name: its path, or its name alone.

    Raises:
        UserError: no such file was confirmed, or the settings cannot be read or written.
    """
    for file in confirmed_names("effects"):
        if name.resolve() == Path(file).resolve() or str(name) == Path(file).name:
            forget_file(file, "effects")
            return file
    raise UserError(f"{name} was never confirmed as an effect of your own; there is nothing to forget.")


def find(name: Path) -> OwnSource:
    """A file of the chosen folder, by its path or by its name alone; it is read, not run.

    Raises:
        UserError: no folder was chosen, or the file is not in it.
    """
    folder = read_settings().folder
    if folder is None:
        raise UserError(
            "No folder of own effects was chosen; choose one with 'fingerlab effects --folder DIR'."
        )
    for source in _sources(folder):
        path = Path(source.file)
        if name.resolve() == path.resolve() or str(name) == path.name:
            return source
    raise UserError(f"{name} is not a Python file in {folder}, the folder of your own effects; put it there.")


def trust(source: OwnSource, taken: Collection[str]) -> OwnFile:
    """Remember that the user lets exactly this content be run, now and from now on, and run it.

    Call it only after the user was asked; ``source`` is what they were shown (:func:`find`).

    Raises:
        UserError: the settings cannot be written.
    """
    confirm(source, "effects")
    for file in own_files(taken):
        if file.source == source:
            return file
    raise UserError(f"{source.file} was changed meanwhile; look at it again and confirm it anew.")


def trusted_sources(taken: Collection[str]) -> tuple[OwnSource, ...]:
    """The confirmed files that work: what another process needs to know the same effects."""
    return tuple(file.source for file in own_files(taken) if file.effects)


@contextmanager
def only_these(sources: Sequence[OwnSource]) -> Iterator[None]:
    """Own effects are these confirmed ones and no others, whatever the settings of this machine say."""
    token = _FIXED.set(tuple(sources))
    try:
        yield
    finally:
        _FIXED.reset(token)


_FIXED: ContextVar[tuple[OwnSource, ...] | None] = ContextVar("own_sources", default=None)
_LOADED: dict[OwnSource, OwnFile] = {}
"""Each content is run once in a process, so that its effects stay the same objects."""
_LOADING = Lock()


def _sources(folder: Path | None) -> list[OwnSource]:
    """The Python files right in the folder; one that cannot be read is as good as absent."""
    if folder is None or not folder.is_dir():
        return []
    found = []
    for path in sorted(folder.glob("*.py")):
        try:
            found.append(OwnSource(str(path), path.read_bytes()))
        except OSError:
            continue
    return found


def _loaded(source: OwnSource) -> OwnFile:
    with _LOADING:
        if source not in _LOADED:
            try:
                _LOADED[source] = OwnFile(source, _run(source))
            except UserError as error:
                _LOADED[source] = OwnFile(source, problem=str(error))
            except Exception as error:  # something that no check foresaw is the file's fault all the same
                _LOADED[source] = OwnFile(source, problem=f"{told(error, source.file)}.")
        return _LOADED[source]


def _run(source: OwnSource) -> tuple[Effect, ...]:
    """Run the file and check what it offers.

    Raises:
        UserError: it fails, or offers nothing, or something that is no good effect.
    """
    # Files written for earlier versions know the catalogue by this name.
    sys.modules.setdefault("fingerlab.physics.effects", sys.modules["fingerlab.effects"])
    try:
        module = run_source(source, f"fingerlab_own_{source.sha256[:16]}")
    except (Exception, SystemExit) as error:
        raise UserError(f"{told(error, source.file)}; put it right and confirm the file anew.") from None
    if hasattr(module, "EFFECT") == hasattr(module, "EFFECTS"):
        raise UserError(f"{source.file} should define either EFFECT = Effect(...) or EFFECTS = [...].")
    offered = getattr(module, "EFFECTS", None)
    if hasattr(module, "EFFECT"):
        offered = [module.EFFECT]
    if not isinstance(offered, (list, tuple)) or not offered:
        raise UserError(
            f"{source.file} has EFFECTS that are no list of effects; it should name at least one."
        )
    effects = tuple(checked(effect, source.file) for effect in offered)
    ids = [effect.id for effect in effects]
    if len(set(ids)) != len(ids):
        raise UserError(f"{source.file} has two effects of one id; each should have its own.")
    return effects


def _without_taken(file: OwnFile, owners: dict[str, str]) -> OwnFile:
    for effect in file.effects:
        if effect.id in owners:
            return replace(
                file,
                effects=(),
                problem=f"{file.source.file} has an effect '{effect.id}', but that id belongs to "
                f"{owners[effect.id]}; choose another id.",
            )
    return file
