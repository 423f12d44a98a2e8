"""The page's part on the thesis' analysis, on recordings that the project did not make."""

from __future__ import annotations

from pathlib import Path

import pytest

from fingerlab.core.text import in_words, r2_text, with_minus
from fingerlab.report.content import analyse
from fingerlab.sessions import open_session


def quiet(share: float, what: str) -> None:
    """Progress that nobody looks at."""


def test_a_session_on_air_and_in_contact_gives_figures_and_numbers(shared_data: Path) -> None:
    from fingerlab.thesis.fitting import fit_session
    from fingerlab.thesis.traces import FOUR_REGIONS

    session = open_session(shared_data / "bench-coulomb.h5")
    found = analyse([session], quiet)
    assert found is not None
    assert [name[:11] for name, _, _ in found.figures] == [
        "figure-4-02",
        "figure-4-05",
        "figure-4-03",
        "figure-4-08",
        "figure-4-18",
        "figure-4-19",
        "figure-5-02",
    ]
    assert all(figure.axes and caption for _, figure, caption in found.figures)
    published = {title: number for title, _, number in found.numbers}
    # printed in chapters 4 and 5 of the thesis
    assert published["Delay of LHS after tension, finddelay"] == "162.2 ± 23.2 ms"
    assert published["R2 of the normalised force, findsignal 10 %"] == "0.97 ± 0.01"
    assert published["Peak force, measured"] == "0.50 N"
    assert published["Modelled peak as a share of the measured, findsignal 10 %"] == "27.16 %"
    fitted = fit_session(session, FOUR_REGIONS).cables["extension"]["pip", "extension"].pooled
    assert fitted is not None
    row = next(r for r in found.fits if r[:2] == ("PIP", "extension"))
    assert row[2:] == (
        with_minus(in_words(fitted.moment_arm)),
        with_minus(in_words(fitted.loss)),
        r2_text(fitted.r2),
    )


def test_a_real_machine_without_a_finger_gives_the_motor_bench_equation(shared_data: Path) -> None:
    found = analyse([open_session(shared_data / "cable-tool.h5")], quiet)
    assert found is not None
    assert [name for name, _ in found.bench][:3] == ["Inertia J", "Gain on the load", "Offset"]
    assert len(found.by_run) == 20
    assert not found.figures
    assert not found.fits


def test_runs_too_short_to_repeat_are_told_in_a_sentence(make_session) -> None:
    found = analyse([open_session(make_session(samples=1500))], quiet)
    assert found is not None
    assert "on-air run" in found.note
    assert not found.figures


@pytest.mark.parametrize("phases", [(("free", "extension"),), (("contact", "flexion"),)])
def test_a_session_with_neither_gives_nothing(make_session, phases) -> None:
    assert analyse([open_session(make_session(phases=phases))], quiet) is None
