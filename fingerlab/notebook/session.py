"""A session and its runs, as a notebook shows them; opened from a file, or simulated into one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.notebook.data import channel_figure, run_dataset, session_tree
from fingerlab.notebook.diagnosis import DiagnosisView, diagnose
from fingerlab.notebook.display import Displayable, Displayed, ShownTable
from fingerlab.notebook.model import ModelView, effect_ids, fit
from fingerlab.sessions.model import Run, Session
from fingerlab.sessions.reading import open_session

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


class RunView(Displayed):
    """One run. ``run`` is the object behind it (``fingerlab.sessions.Run``)."""

    def __init__(self, run: Run) -> None:
        self.run = run

    @property
    def name(self) -> str:
        """Name in the file, such as ``001``."""
        return self.run.name

    @property
    def channels(self) -> dict[str, str]:
        """Unit of each channel by name."""
        return dict(self.run.units)

    def to_xarray(self, channels: Iterable[str] | None = None) -> xarray.Dataset:
        """The run as a dataset over ``time`` (s), SI units in ``units``; see ``data.run_dataset``."""
        return run_dataset(self.run, channels)

    def figure(self, *channels: str) -> Figure:
        """The channels over time, one above the other; the joints and the motor's torque where none is named.

        Raises:
            UserError: the run has no such channel.
        """
        return channel_figure(self.run, channels)

    def _parts(self) -> Sequence[Displayable]:
        from fingerlab.report.diagnosis_words import PHASE_WORDS
        from fingerlab.sessions.trajectory import run_told

        run = self.run
        cable = "no cable" if run.cable == "none" else f"{run.cable} cable"
        line = (
            f"run {run.name}: {PHASE_WORDS.get(run.phase, run.phase)}, {cable}, "
            f"{run_told(run)}; {run.seconds:.1f} s at {run.sample_rate_hz:g} Hz"
        )
        return (line, ShownTable(("channel", "unit"), list(run.units.items())))


class SessionView(Displayed):
    """A session; its runs by name: ``s["001"]``. ``session`` is the object behind it."""

    def __init__(self, session: Session) -> None:
        self.session = session

    @property
    def path(self) -> Path:
        """The session's file."""
        return self.session.path

    @property
    def runs(self) -> tuple[RunView, ...]:
        """Every run, in the order taken."""
        return tuple(RunView(run) for run in self.session.runs)

    def __len__(self) -> int:
        return len(self.session.runs)

    def __iter__(self) -> Iterator[RunView]:
        return iter(self.runs)

    def __getitem__(self, name: str) -> RunView:
        for run in self.session.runs:
            if run.name == name:
                return RunView(run)
        names = ", ".join(run.name for run in self.session.runs)
        raise UserError(f"{self.path} has no run '{name}'; it holds {names}.")

    def to_xarray(self) -> xarray.DataTree:
        """Every run as a dataset in one tree: ``s.to_xarray()["001"]``; see ``data.session_tree``."""
        return session_tree(self.session)

    def diagnose(self, added: Sequence[str] = (), **options: Any) -> DiagnosisView:
        """Which effect is missing; see ``fingerlab.diagnose``."""
        return diagnose(self, added=added, **options)

    def fit(self, effects: Sequence[str] = ()) -> ModelView:
        """The nominal model with these effects, fitted; see ``fingerlab.fit``."""
        return fit(self, effects=effects)

    def reveal(self) -> dict[str, dict[str, float]]:
        """What a simulated session hides: effect id -> parameter -> value, SI.

        Raises:
            UserError: the session was not simulated.
        """
        from fingerlab.twin.session import reveal_session

        found: dict[str, dict[str, float]] = reveal_session(self.path)["effects"]
        return found

    def _parts(self) -> Sequence[Displayable]:
        from fingerlab.report.page_tables import run_rows

        session = self.session
        seconds = sum(run.seconds for run in session.runs)
        when = f", {session.created}" if session.created else ""
        head = f"{session.path.name}: {session.title or 'session'}{when}, {len(self)} runs, {seconds:.0f} s"
        columns = ("runs", "phase", "cable", "motion", "s", "Hz")
        rows = [(r.runs, r.phase, r.cable, r.trajectory, r.seconds, r.rate) for r in run_rows(session)]
        return (head, ShownTable(columns, rows, frozenset({4, 5})))


def open(path: str | Path) -> SessionView:
    """Open a session file; samples are read when they are asked for.

    Raises:
        UserError: the file is missing, damaged, or breaks the session format.
    """
    return SessionView(open_session(path))


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
    from fingerlab.twin.protocols import PROTOCOLS, load_preset
    from fingerlab.twin.session import new_seed, write_session

    if protocol not in PROTOCOLS:
        raise UserError(f"There is no protocol '{protocol}'; there are {', '.join(PROTOCOLS)}.")
    if hidden and effects:
        raise UserError("hidden=True picks the effect itself; leave out effects, or leave out hidden.")
    chosen = parse_effects(tuple(effect_ids(effects)))
    preset = load_preset()
    plans = PROTOCOLS[protocol](preset.numbers["protocol"]["contact_amplitude_deg"])
    number = new_seed() if seed is None else seed
    write_session(Path(path), preset, protocol, plans, chosen, number, hidden, progress)
    return open(path)
