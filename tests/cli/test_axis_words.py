"""What is said of machines with one axis: in the words of such a machine, and one sentence with the other.

The logs are laws written down here, of motions that are sums of sines.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.cli.calling import call, run_main

RATE = 250.0
TIME = np.arange(int(16 * RATE)) / RATE
NOISE = 0.01
"""N m."""
Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def moved(run: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, speed and acceleration of a run, rad and s; another mixture each, about the horizontal."""
    rates, sizes = 2 * np.pi * np.array((0.21, 0.5, 0.83)), np.array((0.55, 0.35, 0.12))
    phases = rates[:, None] * TIME + np.array((0.0, 1.1, 2.3))[:, None] * (run + 1)
    return (
        0.3 + sizes @ np.sin(phases),
        (sizes * rates) @ np.cos(phases),
        -(sizes * rates**2) @ np.sin(phases),
    )


def imported(folder: Path, law: Law, unit: str = "N m") -> Path:
    """Three runs in which this law drives an axis, as a session."""
    files, random = [], np.random.default_rng(4)
    position_unit = "rad" if unit == "N m" else "m"
    for run in range(3):
        q, v, a = moved(run)
        torque = law(q, v, a) + NOISE * random.standard_normal(len(q))
        files.append(folder / f"{run}.csv")
        table = np.stack((TIME, q, torque), axis=1)
        header = f"time (s),position ({position_unit}),torque ({unit})"
        np.savetxt(files[-1], table, "%.7f", delimiter=",", header=header, comments="")
    session = folder / "axis.h5"
    code, _, err = call("import", "--axis", *files, "--out", session)
    assert code == 0, err
    return session


def told(session: Path, *options: object) -> str:
    """What ``diagnose`` prints, with its lines put together."""
    code, out, err = call("diagnose", session, *options)
    assert code == 0, err
    return " ".join(out.split())


@pytest.fixture(scope="module")
def link(tmp_path_factory):
    """An axis that rubs and carries a link of 5 N m, what ``diagnose`` tells of it, and the saved model."""
    folder = tmp_path_factory.mktemp("link")
    session = imported(folder, lambda q, v, a: 0.3 * a + 5.0 * np.sin(q) + 0.6 * np.sign(v))
    return session, told(session, "--budget", "--save", folder / "m.json"), folder / "m.json"


def test_the_weight_of_a_link_is_no_ripple(tmp_path, capsys, link):
    """5 N m once a turn: in the headline, the table, the path and the report it is a weight."""
    session, text, _ = link
    assert "Weight of a link out of balance" in text
    assert "torque_ripple" in text  # the id that --add takes
    assert "ripple" not in text.replace("torque_ripple", "")
    found = re.search(r"amplitude, sine ([\d.]+) ± ([\d.]+) N m", text)
    assert found is not None
    assert float(found[1]) == pytest.approx(5.0, abs=3 * float(found[2]))
    page = tmp_path / "r.html"
    code, _, err = run_main(["report", session, "--out", page], capsys)
    assert code == 0, err
    words = re.sub(r"<[^>]*>", " ", page.read_text())
    assert "Weight of a link out of balance" in words
    assert "ripple" not in words.lower().replace("torque_ripple", "")


OF_A_FINGER = re.compile(
    r"\b(cable|tension|winding|paying|finger|fingertip|joints?|tip|pulley|flex\w*|exten(?:d|sion)\w*|MCP|PIP)\b",
    re.IGNORECASE,
)


def test_a_saved_model_with_a_link_can_be_compared(capsys, link):
    """What was saved is known again, and a machine that presses on nothing has no columns of a force."""
    session, _, model = link
    code, out, err = run_main(["compare", session, "--model", model], capsys)
    assert code == 0, err
    assert "torque_ripple" in out
    assert "force" not in out


def laws() -> dict[str, Law]:
    """One for each kind of answer: nothing, an effect, several, and what no effect tells."""
    return {
        "plain": lambda q, v, a: 0.3 * a,
        "rubs": lambda q, v, a: 0.3 * a + 0.6 * np.sign(v),
        "spring and oil": lambda q, v, a: 0.3 * a + 2.0 * q + 0.3 * v,
        "drag of the air": lambda q, v, a: 0.3 * a + 0.8 * np.abs(v) * v**2 * np.sign(v) * np.cos(3 * q),
    }


@pytest.mark.parametrize("law", laws())
def test_nothing_of_a_finger_is_told_of_an_axis(tmp_path, capsys, law):
    session = imported(tmp_path, laws()[law])
    text = told(session, "--budget", "--draft")
    page = tmp_path / "r.html"
    equation = tmp_path / "e.md"
    code, _, err = run_main(["report", session, "--out", page, "--equation", equation], capsys)
    assert code == 0, err
    body = re.sub(r"(?s)<(style|svg|script|nav)\b.*?</\1>|<[^>]*>", " ", page.read_text())
    # That there is no finger is told, and the table of runs and of calibrations has its columns.
    for known in ("There is no finger in these runs, so that", "Cable Motion of the motor"):
        body = " ".join(body.split()).replace(known, "")
    worst = re.search(
        r"Motor torque of run \d+ at [\d.]+ to [\d.]+ s: ([a-z ]+), at (low|middling|high) torque;", body
    )
    assert worst is not None
    assert worst[1].startswith(("moving forward", "moving backward", "near standstill"))
    assert "load" not in equation.read_text()  # there is none, whose gain would be 0 ± 68
    assert r"\tau_l" not in equation.read_text()
    for where, said in (("text", text), ("page", body), ("equation", equation.read_text())):
        found = OF_A_FINGER.findall(said)
        assert not found, (
            where,
            [said[m.start() - 60 : m.end() + 40] for m in OF_A_FINGER.finditer(said)][:5],
        )


def slow_log(folder: Path, seconds: float) -> Path:
    """A swing that is logged 20 times a second."""
    time = np.arange(int(20 * seconds)) / 20.0
    angle = np.sin(2.0 * time)
    table = np.stack((time, angle, 0.6 * np.sign(np.cos(2.0 * time)) + 0.01 * np.sin(97 * time)), axis=1)
    path = folder / f"slow{seconds:g}.csv"
    np.savetxt(path, table, "%.6f", delimiter=",", header="t (s),q (rad),tau (N m)", comments="")
    return path


def test_a_run_that_is_too_short_is_told_at_its_import_with_the_number_of_its_diagnosis(tmp_path, capsys):
    """Twenty samples a second are read at a quarter of the usual pace: four times three seconds."""
    target = tmp_path / "s.h5"
    code, _, err = run_main(["import", "--axis", slow_log(tmp_path, 3.0), "--out", target], capsys)
    assert code == 0
    assert err.splitlines()[-1] == (
        "Run 001 lasts 3.0 s, too short for a diagnosis: it leaves out 4 s in which the machine settles, and "
        "its filters need 8 s of what follows, so that of this machine it needs 12 s a run, for it is logged "
        "20 times a second. Record longer runs, or log faster."
    )
    code, _, err = run_main(["diagnose", target], capsys)
    assert (code, err.strip().splitlines()[-1].partition(";")[2]) == (
        2,
        " a diagnosis needs at least 12 s: 4 s in which the machine settles are left out, and the filters "
        "need 8 s of what follows.",
    )
    long = tmp_path / "l.h5"
    code, _, err = run_main(["import", "--axis", slow_log(tmp_path, 30.0), "--out", long], capsys)
    assert (code, "too short" in err) == (0, False)
    assert told(long)


def test_what_is_beyond_a_guess_is_not_said_to_be_another_effect(tmp_path):
    """Oil that takes nearly all of the torque: a large value is no fault of the law."""
    session = imported(tmp_path, lambda q, v, a: 0.01 * a + 8.0 * v)
    text = told(session)
    assert text.startswith("Viscous friction")
    assert "assumed bound" not in text


@pytest.mark.parametrize(("kept", "spike"), [(0.0, True), (0.6, False)])
def test_a_jump_that_dies_away_is_no_spike(tmp_path, kept, spike):
    """Every 3 s the torque jumps by 4 N m; a spike is gone with the next sample, a drive's answer is not."""

    def law(q, v, a):
        torque = 0.3 * a + 0.6 * v
        for at in range(600, len(q) - 150, 750):
            torque[at : at + 30] += 4.0 * kept ** np.arange(30)
        return torque

    text = told(imported(tmp_path, law))
    assert ("look at its plug" in text) is spike
    assert ("dies away again" in text) is not spike
    jumps = 3 * len(range(600, len(TIME) - 150, 750))
    assert (f"has {jumps} single spikes in 3 runs" in text) is spike
