"""Recordings in which samples were lost: what lies between the gaps is judged, nothing across them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fingerlab.core.errors import UserError
from fingerlab.diagnosis import diagnose
from fingerlab.diagnosis.signals.segments import segments_of
from fingerlab.sessions import open_session
from fingerlab.sessions.model import Run, Session
from fingerlab.thesis.traces import trace


def with_gaps(run: Run, at_s: tuple[float, ...], lost_s: float) -> Run:
    """The run without the samples of ``lost_s`` from each of the times on."""
    channels = run.load()
    time = channels["time"] - channels["time"][0]
    kept = np.ones(len(time), dtype=bool)
    for at in at_s:
        kept &= (time < at) | (time >= at + lost_s)
    return Run.from_arrays(
        {name: values[kept] for name, values in channels.items()},
        name=run.name,
        phase=run.phase,
        cable=run.cable,
        sample_rate_hz=run.sample_rate_hz,
        trajectory=run.trajectory,
    )


def lossy(session: Session, at_s: tuple[float, ...], lost_s: float) -> Session:
    return replace(session, runs=tuple(with_gaps(run, at_s, lost_s) for run in session.runs))


def test_a_stretch_ends_where_samples_are_lost(shared_data: Path) -> None:
    session = open_session(shared_data / "bench-plain.h5")
    whole = next(segments_of(session.runs[0], session.rig))
    first, second = segments_of(with_gaps(session.runs[0], (8.0,), 0.5), session.rig)
    assert first.time[0] == whole.time[0]
    assert first.time[-1] < 8.0
    assert second.time[0] == pytest.approx(8.5, abs=0.1)
    assert second.time[-1] == pytest.approx(whole.time[-1], abs=0.02)
    # The same moments say the same, once the filter's edges and its lead are behind.
    late = whole.time > 12.0
    again = np.interp(whole.time[late], second.time, second.acceleration)
    size = np.std(whole.acceleration[late])
    assert np.sqrt(np.mean((again - whole.acceleration[late]) ** 2)) < 0.02 * size


@pytest.mark.parametrize(("name", "effect"), [("bench-coulomb", "coulomb_friction")])
def test_lost_samples_change_no_verdict(shared_data: Path, name: str, effect: str | None) -> None:
    """A tenth of a second is lost twice in every run; it was once "not in the catalogue" with 4.1 floors."""
    answer = diagnose([lossy(open_session(shared_data / f"{name}.h5"), (7.0, 13.0), 0.1)], with_curves=False)
    assert answer.final_model == ((effect,) if effect else ())
    assert answer.path[-1].score < 1.3


def test_a_run_that_is_all_gaps_is_refused_in_a_sentence(shared_data: Path) -> None:
    session = open_session(shared_data / "bench-plain.h5")
    holes = tuple(float(t) for t in range(1, 20))
    with pytest.raises(UserError, match=r"Run 001 has so many gaps that no 4 s of it are whole"):
        diagnose([lossy(session, holes, 0.05)], with_curves=False)


def test_runs_that_are_all_gaps_are_left_aside_and_told_beside_whole_ones(shared_data: Path) -> None:
    """One on air and one in contact; the session was once refused for them."""
    session = open_session(shared_data / "bench-coulomb.h5")
    last = max(k for k, run in enumerate(session.runs) if run.phase == "contact")
    holes = tuple(float(t) for t in range(1, 20))
    runs = [with_gaps(run, holes, 0.05) if k in (0, last) else run for k, run in enumerate(session.runs)]
    answer = diagnose([replace(session, runs=tuple(runs))], with_curves=False)
    assert answer.final_model == ("coulomb_friction",)
    (found,) = [one for one in answer.bench if one.kind == "lost_samples" and one.unit == "runs"]
    assert found.runs == (session.runs[0].name, session.runs[last].name)
    assert found.sentence.endswith("have gaps that leave no stretch long enough; they are left aside")


def test_the_thesis_analysis_takes_the_longest_whole_piece(shared_data: Path) -> None:
    """Its periods are as long as ever, and lie where nothing is lost: the same mean tension in a period."""
    session = open_session(shared_data / "bench-plain.h5")
    whole = trace(session.runs[0], session.rig)
    broken = trace(with_gaps(session.runs[0], (7.0,), 0.35), session.rig)
    assert whole.grid is not None
    assert broken.grid is not None
    assert broken.signals.time[0] == pytest.approx(7.35, abs=2e-3)
    assert len(broken.signals) == pytest.approx(12_650, abs=2)
    assert broken.grid.period == whole.grid.period
    means = [t.grid.mean(t.tension).mean() for t in (whole, broken) if t.grid is not None]
    assert means[1] == pytest.approx(means[0], rel=5e-3)
