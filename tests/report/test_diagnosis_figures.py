"""Figures of a diagnosis show its numbers, in the units that their axes name."""

from __future__ import annotations

import html
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex

from fingerlab.report.diagnosis_figures import (
    chosen_stretches,
    comparison_figure,
    diagnosis_figures,
    failure_stretch,
    fingerprint_figure,
    path_figure,
)
from fingerlab.report.figure_style import (
    CANDIDATE,
    FLOOR,
    MEASURED,
    MODELLED,
    RESIDUAL,
    inline_svg,
    label,
    new_figure,
)


def lines(axes) -> dict[str, object]:
    return {line.get_label(): line for line in axes.get_lines()}


def test_the_worst_run_and_the_middle_one_are_picked(found) -> None:
    # friction 4.8, 9.6 and 0 mN m in runs 001, 002 and 003
    assert [s.comparison.run for s in chosen_stretches(found.comparisons, "pip_torque")] == ["002", "001"]
    assert chosen_stretches(found.comparisons, "mcp_torque") == ()
    only = chosen_stretches(found.comparisons[:1], "pip_torque")
    assert [s.comparison.run for s in only] == ["001"]


def test_every_figure_tells_what_it_shows_and_of_which_session(found) -> None:
    drawn = diagnosis_figures(replace(found, sessions=("there/bench.h5",)))
    told = {name: figure.get_suptitle() for name, figure in drawn.items()}
    assert told["error-path"] == "Error path – bench.h5; the nominal model"
    assert told["pip-torque-1"] == "PIP torque, run 002 – bench.h5; the nominal model"
    assert all("bench.h5" in words for words in told.values())


def test_the_stretch_of_the_failure_holds_it(found) -> None:
    shown = failure_stretch(found.comparisons, found.failure)
    assert shown is not None
    assert shown.comparison.run == "002"
    assert shown.start <= 5.0
    assert shown.stop >= 5.5
    assert shown.stop - shown.start == pytest.approx(5.0)


def test_curves_are_the_comparison_in_millinewton_metres(found) -> None:
    shown = chosen_stretches(found.comparisons, "pip_torque")[1]
    figure = comparison_figure(shown, found.failure)
    above, below = figure.axes
    drawn = lines(above)
    time = drawn["measured"].get_xdata()
    assert time[0] >= shown.start
    assert time[-1] <= shown.stop + 1e-9
    spring = 15.0 * np.sin(2 * np.pi * time)  # 0.05 N m/rad times 0.3 rad, mN m
    np.testing.assert_allclose(drawn["modelled"].get_ydata(), spring, atol=1e-9)
    np.testing.assert_allclose(
        drawn["measured"].get_ydata() - spring, 4.8 * np.sign(np.cos(2 * np.pi * time)), atol=1e-9
    )
    np.testing.assert_allclose(
        lines(below)["residual"].get_ydata(), 4.8 * np.sign(np.cos(2 * np.pi * time)), atol=1e-9
    )
    assert above.get_ylabel() == "PIP torque (mN m)"
    assert below.get_ylabel() == "residual (mN m)"
    assert below.get_xlabel() == "time in the run (s)"
    band = next(p for p in below.patches if p.get_label() == "floor")
    assert (band.get_y(), band.get_height()) == (pytest.approx(-0.4), pytest.approx(0.8))
    colours = [to_hex(lines(a)[n].get_color()) for a, n in
               ((above, "measured"), (above, "modelled"), (below, "residual"))]  # fmt: skip
    assert colours == [c.lower() for c in (MEASURED, MODELLED, RESIDUAL)]
    assert to_hex(band.get_facecolor()) == FLOOR


def test_gaps_stay_gaps(found) -> None:
    shown = failure_stretch(found.comparisons, found.failure)
    whole = type(shown)(shown.comparison, 2.0, 14.0)
    drawn = lines(comparison_figure(whole).axes[0])["measured"]
    silent = (drawn.get_xdata() < 3.0) | (drawn.get_xdata() > 13.0)
    np.testing.assert_array_equal(np.isnan(drawn.get_ydata()), silent)


def test_a_model_far_off_is_cut_and_the_figure_says_so(found) -> None:
    far = replace(found.comparisons[0], modelled=100 * found.comparisons[0].modelled)
    above = comparison_figure(chosen_stretches([far], "pip_torque")[0]).axes[0]
    assert above.get_ylim()[1] < 200  # the model reaches 1500 mN m
    assert [t.get_text() for t in above.texts] == ["cut: modelled reaches −1500 to 1500 mN m"]


def test_a_little_beyond_is_shown_and_not_cut(found) -> None:
    """A fortieth of the axis would be saved."""
    near = replace(found.comparisons[0], modelled=4.2 * found.comparisons[0].measured)
    above = comparison_figure(chosen_stretches([near], "pip_torque")[0]).axes[0]
    assert not above.texts
    assert above.get_ylim()[1] > 4.2 * 1000 * np.nanmax(found.comparisons[0].measured)


def test_the_fingerprint_has_bins_intervals_and_curve(found) -> None:
    (axes,) = fingerprint_figure(found.candidates[0].fingerprint, "Coulomb joint friction").axes
    (bars,) = axes.containers
    points, _, (vertical,) = bars.lines
    speed = np.degrees(np.linspace(-1.75, 1.75, 8))
    np.testing.assert_allclose(points.get_xdata(), speed)
    np.testing.assert_allclose(points.get_ydata(), 4.8 * np.sign(speed))
    ends = np.array([s[:, 1] for s in vertical.get_segments()])
    np.testing.assert_allclose(ends[:, 1] - ends[:, 0], 0.4)  # 90 % interval of +- 0.2 mN m
    curve = lines(axes)["Coulomb joint friction"]
    np.testing.assert_allclose(curve.get_ydata(), 1.1 * 4.8 * np.sign(speed))
    assert to_hex(curve.get_color()) == CANDIDATE.lower()
    assert axes.get_xlabel() == "joint speed (°/s)"
    assert axes.get_ylabel() == "residual, PIP torque (mN m)"


def test_the_path_shows_every_step_down_to_the_floor(found) -> None:
    (axes,) = path_figure(found.path, ()).axes
    assert [bar.get_width() for bar in axes.containers[0]] == [12.4, 1.1]
    assert [t.get_text() for t in axes.get_yticklabels()] == ["nominal model", "+ Coulomb joint friction"]
    assert [t.get_text() for t in axes.texts] == ["12.4", "1.10"]
    (axes,) = path_figure(found.path, ("cable_slack",)).axes
    assert axes.get_yticklabels()[0].get_text() == "model as given"


def test_names_with_dollars_are_letters_and_no_mathematics() -> None:
    """What matplotlib takes for a formula without an end would end the report."""
    names = ["$x_{$", "$\\frac{1}{$", "a $b$ c"]
    figure, (axes,) = new_figure()
    axes.barh(range(len(names)), [1.0, 2.0, 3.0])
    axes.set_yticks(range(len(names)), names)
    label(axes, "$\\unknown{", "score", title="$x_{$")
    drawn = re.sub(r"<[^>]*>", "", inline_svg(figure, "f1", "names"))
    for words in (*names, "$\\unknown{"):
        assert words in html.unescape(drawn)
