"""Chapters 4 and 5 of the thesis on a session: every number of the published table, in one call.

Source of the published numbers: thesis chapters 4 and 5, as ``docs/replicate.md`` prints them. Where
the print gives no deviation none is made up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fingerlab.core.progress import Progress
from fingerlab.sessions.model import Array, Run, Session
from fingerlab.signals.periods import REGIONS
from fingerlab.thesis.contact import (
    FINAL,
    ContactRun,
    PredictionSpec,
    parameter_set,
    prediction_specs,
    reduce_contact_run,
)
from fingerlab.thesis.fitting import SessionFit, assemble, in_pieces, on_air_runs
from fingerlab.thesis.onair import OnAirRun, Spread, reduce_run
from fingerlab.thesis.prediction import AngleStep, ParameterSet, angle_sweep
from fingerlab.thesis.traces import (
    FOUR_REGIONS,
    JOINTS,
    FitSpec,
    Joint,
    RunExcerpt,
    example,
    thesis_specs,
    trace,
)


@dataclass(frozen=True)
class Published:
    """A published number: key, what it is, unit, value and standard deviation (None where not printed)."""

    key: str
    title: str
    unit: str
    value: float | None
    deviation: float | None = None


PUBLISHED: tuple[Published, ...] = (
    Published("r2_flexion", "R2 of the regression, MCP and PIP, flexion", "1", 0.587),
    Published("r2_extension", "R2 of the regression, MCP and PIP, extension", "1", 0.733),
    Published("r2_static_1", "R2 of the regression, MCP and PIP, static 1", "1", 0.319),
    Published("r2_static_2", "R2 of the regression, MCP and PIP, static 2", "1", 0.230),
    Published("r2_pip_extension", "R2 of the regression, PIP, extension", "1", 0.844, 0.203),
    Published("r2_pip_static_1", "R2 of the regression, PIP, static 1", "1", 0.406, 0.319),
    Published("r2_pip_static_2", "R2 of the regression, PIP, static 2", "1", 0.213, 0.176),
    Published("r2_force_four_regions", "R2 of the force, four regions", "1", 0.36, 0.13),
    Published("peak_measured", "Peak force, measured", "N", 0.50),
    Published("peak_extension", "Peak force, extension parameters", "N", 0.16),
    Published("peak_flexion", "Peak force, flexion parameters", "N", 0.88),
    Published("delay_finddelay", "Delay of LHS after tension, finddelay", "ms", 162.2, 23.2),
    Published("delay_xcorr", "Delay of LHS after tension, cross-correlation round the period", "ms", None),
    Published("r2_extension_finddelay_20", "R2, PIP extension, finddelay, 20 %", "1", 0.450, 0.242),
    Published("r2_flexion_findsignal_30", "R2, PIP flexion, findsignal, 30 %", "1", 0.98),
    Published("peak_share", "Modelled peak as a share of the measured, findsignal 10 %", "%", 27.16),
    Published("r2_normalised", "R2 of the normalised force, findsignal 10 %", "1", 0.97, 0.01),
    Published("speed_change_mcp", "Speed range in contact against on air, MCP", "%", -99.5),
    Published("speed_change_pip", "Speed range in contact against on air, PIP", "%", -98.1),
    Published("r2_angle_60", "R2 of the force with the contact angle at 60°", "1", 0.885),
)
"""In the order of the published table; the one without a value is ours alone."""


@dataclass(frozen=True)
class PublishedQuantity:
    """One of our numbers beside the published one; NaN where the session cannot give it.

    ``value`` and ``deviation`` are in ``unit`` and over runs; ``runs`` holds the single values.
    """

    key: str
    title: str
    unit: str
    value: float
    deviation: float
    runs: tuple[float, ...]
    published: float | None
    published_deviation: float | None


def beside_published(ours: Mapping[str, Spread]) -> tuple[PublishedQuantity, ...]:
    """Our numbers in the order of the published table.

    Args:
        ours: values over runs for every key of ``PUBLISHED``, in the unit given there.
    """
    found = ((one, ours[one.key]) for one in PUBLISHED)
    return tuple(
        PublishedQuantity(p.key, p.title, p.unit, o.mean, o.deviation, o.values, p.value, p.deviation)
        for p, o in found
    )


def published_numbers(
    on_air: Sequence[OnAirRun],
    contact: Sequence[ContactRun[PredictionSpec]],
    fits: Mapping[FitSpec, SessionFit],
    cable: str,
    sweep: Sequence[AngleStep],
) -> Mapping[str, Spread]:
    """Every number of the published table over the runs, in the units of ``published``."""
    numbers = _regressions(fits, cable)
    for method in ("finddelay", "xcorr"):
        numbers[f"delay_{method}"] = Spread(
            tuple(1e3 * run.delays_s["pip"][method] for run in on_air if "pip" in run.delays_s)
        )
    numbers |= _forces(contact)
    for joint in JOINTS:
        # Range of the average period's speed of each contact run against the mean on air, per cent.
        free = [float(np.ptp(run.curves.speed[joint])) for run in on_air if run.curves is not None]
        held = [float(np.ptp(run.curves.speed[joint])) for run in contact if run.curves is not None]
        numbers[f"speed_change_{joint}"] = Spread(
            tuple(100.0 * (value / float(np.mean(free)) - 1.0) for value in held) if free else ()
        )
    numbers["r2_angle_60"] = Spread(tuple(step.r2 for step in sweep if step.angle_deg == 60.0))
    return numbers


def _regressions(fits: Mapping[FitSpec, SessionFit], cable: str) -> dict[str, Spread]:
    def r2(spec: FitSpec, joint: Joint, region: str) -> Spread:
        results = fits[spec].cables.get(cable)
        return results[joint, region].r2 if results is not None else Spread(())

    numbers = {}
    for region in REGIONS:
        by_joint = [r2(FOUR_REGIONS, joint, region) for joint in JOINTS]
        numbers[f"r2_{region}"] = Spread(tuple(v for spread in by_joint for v in spread.values))
        numbers[f"r2_pip_{region}"] = by_joint[JOINTS.index("pip")]
    numbers["r2_extension_finddelay_20"] = r2(
        FitSpec("flexion-extension", "finddelay", 20), "pip", "extension"
    )
    numbers["r2_flexion_findsignal_30"] = r2(FitSpec("flexion-extension", "findsignal", 30), "pip", "flexion")
    return numbers


def _forces(contact: Sequence[ContactRun[PredictionSpec]]) -> dict[str, Spread]:
    def over(spec: PredictionSpec, name: str, scale: float = 1.0) -> Spread:
        found: Iterable[float] = (
            scale * float(getattr(run.predictions[spec], name)) for run in contact if spec in run.predictions
        )
        return Spread(tuple(found))

    extension = PredictionSpec("pip", FOUR_REGIONS, "extension")
    flexion = PredictionSpec("pip", FOUR_REGIONS, "flexion")
    return {
        "r2_force_four_regions": over(PredictionSpec("pip", FOUR_REGIONS, None), "r2"),
        "peak_measured": over(extension, "peak_measured"),
        "peak_extension": over(extension, "peak_modelled"),
        "peak_flexion": over(flexion, "peak_modelled"),
        "peak_share": over(FINAL, "share", 100.0),
        "r2_normalised": over(FINAL, "normalised_r2"),
    }


@dataclass(frozen=True)
class ThesisAnalysis:
    """The thesis' analysis of one session.

    Attributes:
        cable: the cable whose on-air runs gave the parameters (extension, as in the thesis, if there).
        fits: pooled and single fits by spec; ``fits[FOUR_REGIONS]`` is always there.
        on_air, contact: what was kept of the runs that took part. sweep: contact angles on the
            first contact run that repeats.
        quantities: every number of the published table, ours beside the thesis'.
        example_on_air, example_contact: stretches for the figures; ``example_forces`` the modelled forces
            (N) of the latter.
    """

    session: Path
    cable: str
    fits: Mapping[FitSpec, SessionFit]
    on_air: tuple[OnAirRun, ...]
    contact: tuple[ContactRun[PredictionSpec], ...]
    sweep: tuple[AngleStep, ...]
    quantities: tuple[PublishedQuantity, ...]
    example_on_air: RunExcerpt
    example_contact: RunExcerpt | None
    example_forces: Mapping[PredictionSpec, Array]

    def quantity(self, key: str) -> PublishedQuantity:
        """The number of the published table with this key."""
        return next(q for q in self.quantities if q.key == key)


@dataclass(frozen=True)
class _Contacts:
    runs: tuple[ContactRun[PredictionSpec], ...]
    sweep: tuple[AngleStep, ...]
    shown: RunExcerpt | None
    modelled: Mapping[PredictionSpec, Array]


_Step = Callable[[int, Run], None]


def thesis_analysis(session: Session, progress: Progress | None = None) -> ThesisAnalysis:
    """Run chapters 4 and 5 on a session, run by run.

    Args:
        progress: called with the share done and the run at work; may raise ``Cancelled``.

    Raises:
        UserError: no on-air run repeats a trajectory, or a channel or constant is missing.
    """
    air, contact = on_air_runs(session), in_pieces(session.contact_runs())

    def step(number: int, run: Run) -> None:
        if progress is not None:
            progress(number / (len(air) + len(contact)), f"run {run.name}")

    reduced, shown = _reduce_on_air(session, air, step)
    cable = "extension" if any(run.cable == "extension" for run in reduced) else "flexion"
    ours = tuple(run for run in reduced if run.cable == cable)
    fits = {spec: assemble(session, spec, ours, strict=spec == FOUR_REGIONS) for spec in thesis_specs()}
    specs = prediction_specs()
    sets = {one: parameter_set(fits[one.fit], cable, one.joint, one.region) for one in specs}
    contacts = _reduce_contact(session, contact, sets, lambda i, run: step(len(air) + i, run))
    return ThesisAnalysis(
        session.path,
        cable,
        fits,
        ours,
        contacts.runs,
        contacts.sweep,
        beside_published(published_numbers(ours, contacts.runs, fits, cable, contacts.sweep)),
        shown,
        contacts.shown,
        contacts.modelled,
    )


def _reduce_on_air(
    session: Session, runs: Sequence[Run], step: _Step
) -> tuple[tuple[OnAirRun, ...], RunExcerpt]:
    """Every on-air run reduced, and a stretch of the first that repeats (else of the first)."""
    reduced: list[OnAirRun] = []
    shown: RunExcerpt | None = None
    settled = False
    for number, run in enumerate(runs):
        step(number, run)
        traces = trace(run, session.rig)
        reduced.append(reduce_run(traces, thesis_specs()))
        if shown is None or (not settled and traces.grid is not None):
            shown, settled = example(run, traces), traces.grid is not None
    assert shown is not None  # on_air_runs gives at least one
    return tuple(reduced), shown


def _reduce_contact(
    session: Session, runs: Sequence[Run], sets: Mapping[PredictionSpec, ParameterSet | None], step: _Step
) -> _Contacts:
    """Every contact run predicted; the first is shown and swept over contact angles."""
    reduced: list[ContactRun[PredictionSpec]] = []
    sweep: tuple[AngleStep, ...] = ()
    shown: RunExcerpt | None = None
    modelled: Mapping[PredictionSpec, Array] = {}
    for number, run in enumerate(runs):
        step(number, run)
        traces = trace(run, session.rig)
        contact, forces = reduce_contact_run(traces, sets)
        reduced.append(contact)
        final = sets[FINAL]
        if not sweep and traces.grid is not None and final is not None:
            sweep = angle_sweep(traces, final)
        if shown is None:
            shown = example(run, traces)
            modelled = {spec: shown.cut(force) for spec, force in forces.items()}
    return _Contacts(tuple(reduced), sweep, shown, modelled)
