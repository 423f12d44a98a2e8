"""The whole of chapters 4 and 5, on an invented session and on a foreign one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fingerlab.report.force_figures import FIGURES, thesis_figures
from fingerlab.sessions import open_session
from fingerlab.thesis.analysis import PUBLISHED, ThesisAnalysis, thesis_analysis
from fingerlab.thesis.contact import FINAL
from fingerlab.thesis.traces import FOUR_REGIONS

from . import invented as made


def _contact(number: int):
    """Tension and a load cell that reads four times the force of the PIP balance."""
    t = np.arange(20000) / made.RATE
    force = 0.5 + 0.4 * np.sin(2 * np.pi * t)
    pip = np.radians(25.0) + np.radians(0.05) * np.sin(2 * np.pi * t)
    mcp = np.full(len(t), np.radians(20.0))
    lever = 2 * 0.024 * np.cos(mcp + pip - np.radians(15.0))
    tension = (made.K_PIP * pip + lever * force - made.L_PIP) / made.B
    channels = {
        "motor_position": 0.4 + 0.01 * force,
        "motor_torque": tension * made.RADIUS,
        "mcp_angle": mcp,
        "pip_angle": pip,
        "endpoint_force": 4 * force,
    }
    return made.run(f"{number:03d}", channels, "contact", "flexion")


@pytest.fixture(scope="module")
def invented_analysis() -> ThesisAnalysis:
    air = [made.run(f"{i:03d}", made.on_air(made.sine_tension(phase=0.2 * i), delay=30)) for i in (1, 2, 3)]
    return thesis_analysis(made.session(*air, _contact(4), _contact(5)))


def test_numbers_that_were_built_in(invented_analysis: ThesisAnalysis) -> None:
    value = {q.key: q.value for q in invented_analysis.quantities}
    assert value["delay_xcorr"] == pytest.approx(30.0, abs=1e-9)
    assert 20.0 < value["delay_finddelay"] <= 30.0  # biased towards zero
    assert value["peak_measured"] == pytest.approx(3.6, abs=2e-3)
    assert value["peak_share"] == pytest.approx(25.0, abs=0.2)
    # The force comes with the tension, the delay fitted on air shifts it by 30 ms: two sines 10.8° apart.
    assert value["r2_normalised"] == pytest.approx(1 - 2 * (1 - np.cos(2 * np.pi * 0.030)), abs=2e-3)
    assert value["r2_flexion_findsignal_30"] > 0.9999
    assert value["r2_pip_extension"] < 1.0
    # PIP swings by B * 4 N / K_PIP = 0.467 rad peak to peak on air and by 0.1 degrees in contact.
    free = made.B * 4 / made.K_PIP
    assert value["speed_change_pip"] == pytest.approx(100 * (np.radians(0.1) / free - 1), abs=0.01)
    assert value["speed_change_mcp"] == pytest.approx(-100.0, abs=0.01)


def test_keys_and_published_values_are_the_tables(invented_analysis: ThesisAnalysis) -> None:
    """Values from the thesis' text, sections 4.1, 4.2 and 5, typed here once more."""
    printed = {
        "r2_flexion": (0.587, None),
        "r2_extension": (0.733, None),
        "r2_static_1": (0.319, None),
        "r2_static_2": (0.230, None),
        "r2_pip_extension": (0.844, 0.203),
        "r2_pip_static_1": (0.406, 0.319),
        "r2_pip_static_2": (0.213, 0.176),
        "r2_force_four_regions": (0.36, 0.13),
        "peak_measured": (0.50, None),
        "peak_extension": (0.16, None),
        "peak_flexion": (0.88, None),
        "delay_finddelay": (162.2, 23.2),
        "delay_xcorr": (None, None),
        "r2_extension_finddelay_20": (0.450, 0.242),
        "r2_flexion_findsignal_30": (0.98, None),
        "peak_share": (27.16, None),
        "r2_normalised": (0.97, 0.01),
        "speed_change_mcp": (-99.5, None),
        "speed_change_pip": (-98.1, None),
        "r2_angle_60": (0.885, None),
    }
    ours = {q.key: (q.published, q.published_deviation) for q in invented_analysis.quantities}
    assert ours == printed
    assert [q.key for q in invented_analysis.quantities] == [p.key for p in PUBLISHED]


def test_a_session_without_contact_has_no_force_numbers() -> None:
    analysis = thesis_analysis(made.session(made.run("001", made.on_air(made.sine_tension()))))
    assert np.isnan(analysis.quantity("peak_measured").value)
    assert np.isnan(analysis.quantity("r2_angle_60").value)
    assert analysis.quantity("r2_pip_extension").value > 0.999
    assert analysis.contact == ()
    names = set(thesis_figures(analysis, "bench.h5"))
    assert "figure-4-02-regions" in names
    assert "figure-4-18-amplitudes" not in names


def test_every_figure_draws_what_the_analysis_says(invented_analysis: ThesisAnalysis) -> None:
    figures = thesis_figures(invented_analysis, "bench.h5")
    assert set(figures) == set(FIGURES)
    for name, figure in figures.items():
        for axes in figure.axes:
            assert axes.get_ylabel(), name
            assert "(" in axes.get_ylabel(), name  # quantity and unit
        assert any(axes.get_xlabel() for axes in figure.axes) or name == "figure-4-15-r2-means"
    bars = [p.get_height() for p in figures["figure-4-18-amplitudes"].axes[0].patches]
    prediction = invented_analysis.contact[0].predictions[FINAL]
    assert bars[0] == pytest.approx(prediction.peak_modelled)
    assert bars[2] == pytest.approx(prediction.peak_measured - prediction.peak_modelled)
    delays = [p.get_height() for p in figures["figure-4-10-delays"].axes[0].patches]
    assert delays == pytest.approx(invented_analysis.quantity("delay_finddelay").runs)
    r2 = [p.get_height() for p in figures["figure-4-03-r2-four-regions"].axes[0].patches]
    flexion = invented_analysis.fits[FOUR_REGIONS].cables["extension"]
    assert r2 == pytest.approx([*flexion["mcp", "flexion"].r2.values, *flexion["pip", "flexion"].r2.values])


def test_foreign_thesis_protocol(shared_data: Path) -> None:
    """Ten runs each; sheath friction makes the motion regions good and the static ones poor, as told."""
    analysis = thesis_analysis(open_session(shared_data / "bench-thesis-protocol.h5"))
    assert len(analysis.on_air) == len(analysis.contact) == 10
    for region in ("flexion", "extension"):
        assert analysis.quantity(f"r2_{region}").value > 0.95
    for region in ("static_1", "static_2"):
        assert analysis.quantity(f"r2_{region}").value < 0.5
    assert analysis.quantity("speed_change_pip").value < -95
    assert len(analysis.quantity("r2_flexion").runs) == 20
