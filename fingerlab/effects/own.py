"""A user's own effects: each a small Python file in a folder that they chose.

A file runs only after its user has confirmed exactly this content, here by :func:`trust`; an unconfirmed or
changed one is read, and never run. It defines ``EFFECT = Effect(...)`` or ``EFFECTS = [...]`` with the
same :class:`~fingerlab.effects.base.Effect` as the built-in catalogue.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from string import Template
from threading import Lock

from fingerlab.core.errors import UserError
from fingerlab.core.files import whole_file
from fingerlab.core.trust import (
    OwnSettings,
    OwnSource,
    State,
    confirm,
    confirmed_names,
    error_with_line,
    forget_file,
    read_settings,
    run_source,
    with_state,
    write_settings,
)
from fingerlab.effects.base import Effect, Row
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


@dataclass(frozen=True)
class _Law:
    """A law to start from, by the equation in which the model fails."""

    row: Row
    family: str
    lines: tuple[str, ...]
    coordinate: str
    unit: str
    typical: float
    equation: str
    symbols: str


_NO_JOINTS = ("if motion.joints is None:  # a run of the motor alone", "    return []")
_LAWS = {
    **{
        name: _Law(
            row,
            "joint_torque",
            (
                *_NO_JOINTS,
                f"speed = motion.joints.{joint}_velocity  # rad/s",
                "torque = speed * np.abs(speed)  # N m at the joint",
                f'return [Term(Row.{row.name}, "strength", torque, "joint")]',
            ),
            "joint speed",
            "N m s^2/rad^2",
            1e-4,
            rf"\tau_{index} = C\,\dot\theta_{index}|\dot\theta_{index}|",
            "C: strength.",
        )
        for name, row, joint, index in (("mcp", Row.MCP, "mcp", 1), ("pip", Row.PIP, "pip", 2))
    },
    "cable": _Law(
        Row.CABLE,
        "cable_kinematics",
        (
            *_NO_JOINTS,
            "length = motion.tension * np.abs(motion.tension)  # m of cable; the tension in N",
            'return [Term(Row.CABLE, "strength", length)]',
        ),
        "tension",
        "m/N^2",
        1e-6,
        r"x = C\,T|T|",
        "C: strength.",
    ),
    "motor": _Law(
        Row.BENCH,
        "motor_torque",
        (
            "torque = motion.velocity * np.abs(motion.velocity)  # N m; the motor's speed in rad/s",
            "if motion.finger is None:  # a run of the motor alone",
            '    return [Term(Row.BENCH, "strength", torque)]',
            "tension = torque / motion.radius  # N, which both joints miss",
            'return [Term(Row.MCP, "strength", tension), Term(Row.PIP, "strength", tension)]',
        ),
        "motor speed",
        "N m s^2/rad^2",
        1e-4,
        r"\tau_m = C\,\dot\theta_m|\dot\theta_m|",
        "C: strength.",
    ),
}
"""A square of speed or tension, which no effect of the catalogue is; the strengths are assumed."""


def template(path: Path, equation: str = "", found: str = "") -> str:
    """An effect to be edited, which can be let in as it stands.

    Args:
        path: of its file; its name becomes the effect's id and title. equation: in which the model fails, an
            id of a comparison. found: a sentence on where it fails.

    Raises:
        UserError: no id can be made of the file's name.
    """
    name = own_name(path)
    law = next((law for part, law in _LAWS.items() if part in equation), _LAWS["pip"])
    text = files("fingerlab.resources").joinpath("effects", "own.py.txt").read_text(encoding="utf-8")
    return Template(text).substitute(
        id=name,
        title=name.replace("_", " ").capitalize(),
        found=re.sub(r'[\\"]', "'", found) or "The model fails, and no effect of the catalogue explains it.",
        bench=law.row is Row.BENCH,
        law="\n".join(f"    {line}" for line in law.lines),
        family=law.family,
        unit=law.unit,
        high=f"{10 * law.typical:g}",
        typical=f"{law.typical:g}",
        coordinate=law.coordinate,
        row=law.row.name,
        grows=law.coordinate.upper(),
        equation=law.equation,
        symbols=law.symbols,
        symbol="C",
    )


def own_name(path: Path) -> str:
    """The id that an own effect has by the name of its file.

    Raises:
        UserError: none can be made of it.
    """
    name = re.sub(r"[^a-z0-9]+", "_", path.stem.lower()).strip("_")
    if path.suffix != ".py" or not name[:1].isalpha():
        raise UserError(
            f"{path.name} should begin with a letter and end in .py; its name is the effect's id."
        )
    return name


def how_to_let_in(path: Path) -> str:
    """What is to be done with a file that was written, the rest of a sentence."""
    folder = "" if read_settings().folder is not None else f" --folder {path.resolve().parent}"
    return f"put its law and texts right, then let it in with 'fingerlab effects{folder} --trust {path.name}'"


def save_own(path: Path, text: str, choose: bool = True) -> None:
    """Write an effect's file into the folder of own effects; the first one says which folder that is.

    Nothing is run by that; a file that is there is replaced.

    Args:
        choose: remember its folder where none was chosen.

    Raises:
        UserError: it belongs elsewhere, or cannot be written.
    """
    folder = read_settings().folder
    if folder is not None and path.resolve().parent != folder.resolve():
        raise UserError(f"{path.name} should stand in {folder}, where your own effects are; save it there.")
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
    if folder is None and choose:
        set_folder(path.parent)


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
                _LOADED[source] = OwnFile(source, problem=f"{error_with_line(error, source.file)}.")
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
        raise UserError(
            f"{error_with_line(error, source.file)}; put it right and confirm the file anew."
        ) from None
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
