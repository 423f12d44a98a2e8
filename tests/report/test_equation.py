"""The fitted model as equations: what is printed, read back, is the model."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from fingerlab.core.errors import UserError
from fingerlab.effects import CATALOGUE
from fingerlab.models.file import ParameterEstimate
from fingerlab.physics import nominal
from fingerlab.prediction.extended import ChosenEffect, ExtendedModel, Variant
from fingerlab.report.equation import final_equation, fitted_finger, latex, signed
from fingerlab.report.equation_text import (
    check_ending,
    equation_figures,
    html_words,
    latex_words,
    markdown_words,
    to_latex,
    to_markdown,
)
from fingerlab.rig.file import Rig, default_rig


def estimate(value: float, unit: str, half: float = 0.0) -> ParameterEstimate:
    return ParameterEstimate(value, unit, value - half, value + half)


PARAMETERS = {
    "proximal_mass": estimate(-0.05, "1"),
    "distal_mass": estimate(0.02, "1"),
    "mcp_stiffness": estimate(0.1, "1"),
    "torque_gain": estimate(0.03, "1"),
    "force_gain": estimate(-0.02, "1"),
    "lateral": estimate(0.04, "tan"),
    "arm_mcp@extension": estimate(0.0116, "m", 2e-5),
    "arm_pip@extension": estimate(0.0088, "m", 2e-5),
    "loss_mcp@extension": estimate(-6.7e-5, "N m", 2e-4),
    "loss_pip@extension": estimate(2.9e-5, "N m", 2e-4),
    "trace_mcp": estimate(5e-5, "N m s/rad", 3e-5),
    "trace_pip": estimate(4e-5, "N m s/rad", 3e-5),
    "offset@extension": estimate(0.00142, "m", 2e-6),
    "cable_compliance": estimate(2.6e-5, "m/N", 1e-6),
    "coulomb_friction.coulomb_mcp": estimate(0.0037, "N m", 1e-4),
    "coulomb_friction.coulomb_pip": estimate(0.0026, "N m", 1e-4),
}


def model(*effects: ChosenEffect) -> ExtendedModel:
    variant = Variant(tuple(effects), {}, (), 1.0)
    return ExtendedModel(variant, variant, PARAMETERS, ())


def coulomb() -> ChosenEffect:
    return ChosenEffect(CATALOGUE["coulomb_friction"], {"travel_deg": 0.12})


def in_python(latex: str) -> str:
    """A printed line as an expression of t1, t2, their derivatives v and a, T, F and the levers l."""
    text = re.sub(r"\\times 10\^\{(-?\d+)\}", r"e\1", latex)
    text = re.sub(r"\\ddot\\theta_(\d)", r" a\1", text)
    text = re.sub(r"\\dot\\theta_(\d)\^2", r" v\1**2", text)
    text = re.sub(r"\\dot\\theta_(\d)", r" v\1", text)
    text = re.sub(r"\\(cos|sin)\\theta_2", r" \1(t2)", text)
    text = re.sub(r"\\(cos|sin)\(", r" \1(", text)
    text = re.sub(
        r"\\(theta|ell|lambda|tau)_(\d)", lambda m: f" {m[1][0] if m[1] != 'tau' else 'x'}{m[2]}", text
    )
    text = text.replace(r"\,", " ").replace(r"\qquad", " ")
    text = re.sub(r"(?<=[\w)]) +(?=[\w(])", " * ", " ".join(text.split()))
    return re.sub(r"(\d)(v\d)", r"\1*\2", text)


def printed_torques(rig: Rig) -> list[str]:
    """Both joints' printed lines, each joined."""
    lines = final_equation(model(), rig).parts[0].lines
    whole: list[str] = []
    for line in lines:
        if "=" in line:
            whole.append(line.split("=", 1)[1])
        else:
            whole[-1] += line
    return whole


def test_the_printed_joint_torques_are_those_of_the_nominal_equations() -> None:
    rig = default_rig()
    assert rig.finger is not None
    random = np.random.default_rng(3)
    t1, t2, v1, v2, a1, a2 = random.uniform(-1.0, 1.0, (6, 50)) * np.array(
        [[1], [1], [20], [20], [300], [300]]
    )
    motion = nominal.JointMotion(t1, t2, v1, v2, a1, a2)
    finger = fitted_finger(rig.finger, PARAMETERS)
    assert finger.proximal_mass == pytest.approx(0.95 * rig.finger.proximal_mass)
    assert finger.distal_inertia == pytest.approx(1.02 * rig.finger.distal_inertia)
    assert finger.mcp_stiffness == pytest.approx(1.1 * rig.finger.mcp_stiffness)
    known = {"t1": t1, "t2": t2, "v1": v1, "v2": v2, "a1": a1, "a2": a2, "cos": np.cos, "sin": np.sin}
    for printed, torque in zip(printed_torques(rig), (nominal.mcp_torque, nominal.pip_torque), strict=True):
        expected = torque(finger, motion).total
        got = eval(in_python(printed), {"__builtins__": {}}, known)
        assert np.abs(got - expected).max() < 2e-3 * np.abs(expected).max()  # four digits are printed


def test_balance_and_levers_have_the_signs_of_the_theory() -> None:
    parts = {part.title: part for part in final_equation(model(coulomb()), default_rig()).parts}
    first = parts["Balance of each joint"].lines[0]
    assert first == (
        r"\mathrm{LHS}_1 = -0.0116\,T - 6.7\times 10^{-5} - 5\times 10^{-5}\,\dot\theta_1 - 0.98\,F\,\ell_1"
        r" - H\,\lambda_1 - \tau_1\qquad\mathrm{(extension\ cable)}"
    )
    levers = parts["Levers of the contact force"]
    assert r"H = 0.04\,F" in levers.lines
    assert (
        levers.note == "F: what the load cell reads. H: force along its face."
    )  # no symbol that is not there
    assert parts["Coulomb joint friction"].lines == (r"\tau_j = C_j\,z(\theta_j;\delta)",)
    assert r"\tau_m" not in parts["Cable tension from the motor"].lines[0]
    plain = {part.title: part for part in final_equation(model(), default_rig()).parts}
    assert r"\tau_1" not in plain["Balance of each joint"].lines[0]


def test_values_carry_symbol_unit_and_interval() -> None:
    values = {v.title: v for v in final_equation(model(coulomb()), default_rig()).values}
    friction, travel = values["MCP friction torque"], values["Travel"]
    assert (friction.symbol, friction.estimate.unit, friction.estimate.value) == ("C_1", "N m", 0.0037)
    assert (travel.symbol, travel.estimate.unit, travel.estimate.value) == (r"\delta", "deg", 0.12)
    text = to_markdown(final_equation(model(coulomb()), default_rig()), "A bench", "the model")
    assert r"| $C_1$ | MCP friction torque | $0.0037 \pm 1\times 10^{-4}$ | N m |" in text
    assert r"| $a$ | Moment arm at the MCP, extension cable | $0.0116 \pm 2\times 10^{-5}$ | m |" in text
    assert text.count("$$") == 2 * len(final_equation(model(coulomb()), default_rig()).parts)


def test_two_effects_of_one_symbol_are_told_apart() -> None:
    motor = ("motor_coulomb_friction", "motor_presliding")
    own = {
        f"{motor[0]}.coulomb": estimate(0.03, "N m"),
        f"{motor[1]}.dahl": estimate(0.01, "N m"),
    }
    effects = [ChosenEffect(CATALOGUE[name], {"travel_deg": 8.0}) for name in motor]
    made = final_equation(replace(model(*effects), parameters=PARAMETERS | own), default_rig())
    titles = [value.title for value in made.values]
    assert len(set(titles)) == len(titles)
    assert "Friction torque at the gearbox output (presliding on the motor side)" in titles
    assert sum("is added up" in part.note for part in made.parts) == 1
    assert "Friction torque at the gearbox output" not in titles


def test_latex_is_balanced_and_every_line_can_be_drawn() -> None:
    equation = final_equation(model(coulomb()), default_rig())
    text = to_latex(equation, "A bench_1 & more", "the model")
    assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") == len(equation.parts)
    code = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
    assert code.count("{") == code.count("}")
    assert code.count("$") % 2 == 0
    assert set(equation_figures(equation)) == {part.title for part in equation.parts}


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_effect_can_be_printed_with_a_symbol_for_each_unknown(name: str) -> None:
    effect = CATALOGUE[name]
    assert effect.formula is not None
    symbols = {parameter.name: parameter.symbol for parameter in effect.parameters}
    assert set(effect.formula.values) == set(symbols) == {*effect.unknowns, *effect.shape_units}
    shape = dict(effect.shapes[0]) if len(effect.shapes) else {}
    equation = final_equation(model(ChosenEffect(effect, shape)), default_rig())
    part = next(p for p in equation.parts if p.title == effect.title)
    parser = MathTextParser("path")
    for line in (*part.lines, *symbols.values()):
        parser.parse(f"${line}$")
    body = effect.formula.equation + effect.formula.symbols
    assert len(part.lines) >= 1
    assert body.strip()


def whole(name: str) -> str:
    """LaTeX of a model with that effect and a typical strength of each of its gains."""
    effect = CATALOGUE[name]
    gains = {f"{name}.{key}": estimate(g.typical, g.unit, 0.1 * g.typical) for key, g in effect.gains.items()}
    chosen = ChosenEffect(effect, dict(effect.shapes[0]) if len(effect.shapes) else {})
    variant = Variant((chosen,), {}, (), 1.0)
    fitted = ExtendedModel(variant, variant, {**PARAMETERS, **gains}, ())
    return to_latex(final_equation(fitted, default_rig()), "A bench_1 & more", f"the model with {name}")


def test_every_model_s_latex_compiles(tmp_path: Path) -> None:
    """A page for each effect, with a real TeX; every word of it in letters that any TeX takes."""
    pages = [whole(name) for name in sorted(CATALOGUE)]
    assert all(page.isascii() for page in pages)
    if shutil.which("pdflatex") is None:
        pytest.skip("no TeX is installed here; apt-get install texlive-latex-recommended brings one")
    head = "\\documentclass[a4paper]{article}\n\\usepackage[margin=20mm]{geometry}\\usepackage{amsmath}\n"
    text = head + "\\begin{document}\n" + "\n\\clearpage\n".join(pages) + "\n\\end{document}\n"
    (tmp_path / "all.tex").write_text(text, encoding="utf-8")
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"],
        cwd=tmp_path, capture_output=True, text=True, errors="replace", check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
    assert f"({len(pages)} pages" in done.stdout


def test_symbols_in_a_sentence_become_mathematics() -> None:
    assert latex_words("C_j: torque, −1 to 1 & 50 % of f_H.") == (
        r"$C_{j}$: torque, $-$1 to 1 \& 50 \% of $f_{H}$."
    )
    assert latex_words("ΔK_j over l₁; 1/a(θ₁)") == r"$\Delta K_{j}$ over $l_{1}$; 1/a($\theta_{1}$)"
    assert html_words("θ₁, f_H < 3 & C_j: torque") == (
        "<var>θ<sub>1</sub></var>, <var>f<sub>H</sub></var> &lt; 3 &amp; <var>C<sub>j</sub></var>: torque"
    )
    # In Markdown a space before the last mark would be no mathematics; what LaTeX escapes stays.
    assert markdown_words("δ: 50 % of f_H, [T_c](a.md).") == r"$\delta$: 50 % of $f_{H}$, [$T_{c}$](a.md)."


def test_a_shape_has_the_interval_that_the_diagnosis_gave_it() -> None:
    seen = {"coulomb_friction": {"travel_deg": ParameterEstimate(0.12, "deg", 0.08, 0.2)}}
    values = {v.title: v.estimate for v in final_equation(model(coulomb()), default_rig(), seen).values}
    assert (values["Travel"].low, values["Travel"].high) == (0.08, 0.2)
    seen = {"coulomb_friction": {"travel_deg": ParameterEstimate(0.3, "deg", 0.08, 0.4)}}
    values = {v.title: v.estimate for v in final_equation(model(coulomb()), default_rig(), seen).values}
    assert values["Travel"].low == values["Travel"].high == 0.12  # another shape than the fit's


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.0116, "0.0116"),
        (-1.33412e-5, r"-1.334\times 10^{-5}"),
        (5e-5, r"5\times 10^{-5}"),
        (0.26179939, "0.2618"),
        (123456.0, r"1.235\times 10^{5}"),
    ],
)
def test_numbers_are_printed_with_the_digits_that_count(value: float, text: str) -> None:
    assert latex(value) == text
    assert signed(value) == (f"- {latex(-value)}" if value < 0 else f"+ {text}")


def test_a_file_that_is_neither_markdown_nor_latex_is_refused(tmp_path) -> None:
    check_ending(tmp_path / "a.MD")
    with pytest.raises(UserError, match=r"neither .md"):
        check_ending(tmp_path / "a.txt")
