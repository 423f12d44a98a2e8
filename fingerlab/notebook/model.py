"""A fitted model and what it predicts, as a notebook shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from fingerlab.core.errors import UserError
from fingerlab.core.progress import Progress
from fingerlab.core.text import estimate_text, mean_and_deviation
from fingerlab.models.file import DIAGNOSIS_METHOD, Model, ParameterEstimate, save_model
from fingerlab.notebook.display import Displayable, Displayed, Figures, ShownTable
from fingerlab.report import diagnosis_words as words
from fingerlab.report.page_tables import model_rows
from fingerlab.report.parameter_words import parameter_titles
from fingerlab.sessions.model import Session
from fingerlab.sessions.reading import open_session

if TYPE_CHECKING:
    from fingerlab.prediction import ExtendedPrediction
    from fingerlab.prediction.predict import RunPrediction


class HoldsSession(Protocol):
    """What shows a session, such as ``SessionView``."""

    @property
    def session(self) -> Session:
        """The session behind it."""


SessionSource = HoldsSession | Session | str | Path
"""A session: opened, or its file."""


def opened(source: SessionSource) -> Session:
    """The session behind what a call was given."""
    if isinstance(source, (str, Path)):
        return open_session(source)
    return source if isinstance(source, Session) else source.session


def effect_ids(given: Sequence[str]) -> Sequence[str]:
    """A single id is taken as a list of one, and not as a list of its letters."""
    return (given,) if isinstance(given, str) else given


PREDICTION_COLUMNS = (
    ("R2", "r2", 4, 1.0),
    ("error (mN)", "rmse", 1, 1e3),
    ("cell peak (N)", "peak_measured", 2, 1.0),
    ("model peak (N)", "peak_modelled", 2, 1.0),
)
"""Title, number of a run, digits, and factor to the unit in the title."""


class ModelView(Displayed):
    """A fitted model; ``model`` is the content of its file (``fingerlab.models.file.Model``)."""

    def __init__(self, model: Model, name: str = "this model") -> None:
        self.model = model
        self._name = name

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects in it, in the order in which they were added."""
        return self.model.effects

    @property
    def parameters(self) -> Mapping[str, ParameterEstimate]:
        """Every parameter with its unit and 90 % interval, SI."""
        return self.model.parameters

    def save(self, path: str | Path) -> Path:
        """Write the model file that ``fingerlab predict`` and ``fingerlab compare`` read.

        Raises:
            UserError: the file exists already, or the place cannot be written to.
        """
        save_model(self.model, path)
        return Path(path)

    def predict(self, session: SessionSource) -> PredictionView:
        """Endpoint force of every contact run; a run of the fit is predicted by a fit that has not seen it.

        Raises:
            UserError: no contact run, a cable that the model has not seen, or a model of ``fingerlab fit``,
                which predicts by region ('fingerlab predict').
        """
        from fingerlab.prediction import extended_model, predict_extended

        extended = extended_model(self.model, self._name)
        return PredictionView(predict_extended(opened(session), extended, self._name))

    def _parts(self) -> Sequence[Displayable]:
        model = self.model
        files = words.listed([s.name for s in model.sessions]) if model.sessions else "no session"
        what = (
            words.model_words(model.effects) if model.method == DIAGNOSIS_METHOD else f"a {model.method} fit"
        )
        head = f"{what[:1].upper()}{what[1:]}, fitted on {files} ({model.created})"
        title = "± is half the 90 % interval"
        return (head, ShownTable(("parameter", "value"), _rows(model), frozenset(), title))


def _rows(model: Model) -> list[tuple[str, str]]:
    if model.method != DIAGNOSIS_METHOD:
        return [(name, estimate_text(value)) for name, value in model.parameters.items()]
    rows = model_rows(model.parameters)
    for effect in model.effects:
        own = {
            name.removeprefix(f"{effect}."): value
            for name, value in model.parameters.items()
            if name.startswith(f"{effect}.")
        }
        titles = parameter_titles(effect, list(own))
        rows += [
            (f"{titles[name][:1].upper()}{titles[name][1:]}", estimate_text(value))
            for name, value in own.items()
        ]
    return rows


class PredictionView(Displayed):
    """Endpoint force of contact runs; ``result`` holds it (``prediction.ExtendedPrediction``)."""

    def __init__(self, result: ExtendedPrediction) -> None:
        self.result = result

    def figures(self) -> Figures:
        """Force with its interval, what is missed, peaks by run, normalised force."""
        from fingerlab.report.force_figures import extended_figures

        return Figures(extended_figures(self.result))

    def r2(self, variant: str | None = None) -> float:
        """Mean R2 over the runs, of the ``extended`` or the ``nominal`` model; the former where there is one.

        Raises:
            UserError: there is no such model in this prediction.
        """
        return self._spread(variant, "r2")[0]

    def coverage(self, variant: str | None = None) -> float:
        """Mean share of the load cell's samples inside the 90 % interval; models as for ``r2``."""
        from fingerlab.prediction.predict import interval_over

        return interval_over(self._runs(variant))[1]

    def _runs(self, variant: str | None) -> Sequence[RunPrediction]:
        runs = self.result.runs
        name = variant or next(iter(runs))
        if name not in runs:
            raise UserError(f"This prediction has no model '{name}'; it has {words.listed(list(runs))}.")
        return runs[name]

    def _spread(self, variant: str | None, number: str) -> tuple[float, float]:
        from fingerlab.prediction.predict import spread_over

        spread = spread_over(self._runs(variant), "both", number)
        return spread.mean, spread.deviation

    def _parts(self) -> Sequence[Displayable]:
        rows = [self._row(variant) for variant in self.result.runs]
        runs = next(iter(self.result.runs.values()))
        count = f"{len(runs)} contact run{'' if len(runs) == 1 else 's'}"
        unseen = (
            "each predicted by a fit that has not seen it"
            if all(run.held_out for run in runs)
            else "some of which the fit has seen, or from another session"
        )
        head = f"{self.result.session.name}: endpoint force of {count}, {unseen}"
        columns = ("model", *(title for title, *_ in PREDICTION_COLUMNS), "inside the 90 % interval")
        right = frozenset(range(1, len(columns)))
        return (
            head,
            ShownTable(columns, rows, right, "Mean ± deviation over runs, PIP and MCP equation together"),
        )

    def _row(self, variant: str) -> tuple[str, ...]:
        cells = []
        for _, key, digits, factor in PREDICTION_COLUMNS:
            mean, deviation = self._spread(variant, key)
            cells.append(mean_and_deviation(factor * mean, factor * deviation, digits))
        inside = self.coverage(variant)
        share = f"{100 * inside:.1f} %" if inside == inside else "–"  # NaN: no cell or no interval
        return (variant, *cells, share)


def fit(*sessions: SessionSource, effects: Sequence[str] = (), progress: Progress | None = None) -> ModelView:
    """Fit the nominal model with these effects to the sessions together; it then predicts endpoint force.

    Raises:
        UserError: no session, an unknown effect, one that does not apply, or a run that cannot be read.
    """
    from fingerlab.prediction import fit_extended, model_of_extended

    if not sessions:
        raise UserError("No session was given; name at least one session file.")
    read = [opened(one) for one in sessions]
    return ModelView(model_of_extended(fit_extended(read, effect_ids(effects), progress)))


def load_model(path: str | Path) -> ModelView:
    """Read a model file.

    Raises:
        UserError: the file is missing or no model file.
    """
    from fingerlab.models.file import load_model as load

    return ModelView(load(path), str(path))
