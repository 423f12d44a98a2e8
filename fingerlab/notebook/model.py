"""How objects show themselves in a notebook, and a fitted model with what it predicts."""

from __future__ import annotations

import html
import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from fingerlab.core.errors import UserError
from fingerlab.core.files import OutputSet
from fingerlab.core.progress import Progress
from fingerlab.core.text import NO_BREAK, estimate_text, held_together, mean_and_deviation
from fingerlab.models.file import DIAGNOSIS_METHOD, ParameterEstimate, SavedModel, save_model
from fingerlab.report import diagnosis_words as words
from fingerlab.report.page_tables import model_rows
from fingerlab.report.parameter_words import parameter_titles
from fingerlab.sessions.disk_files import refuse_twice
from fingerlab.sessions.model import Session
from fingerlab.sessions.reading import open_session

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fingerlab.prediction import ExtendedPrediction
    from fingerlab.prediction.predict import RunPrediction

WIDTH = 88
"""Characters of a line of text."""


@dataclass(frozen=True)
class ShownTable:
    """Columns and rows of text; the columns in ``right`` hold numbers and stand at the right."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: frozenset[int] = frozenset()
    title: str = ""

    def text(self) -> str:
        """Aligned lines, two spaces between columns."""
        lines = [self.columns, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        shown = [
            "  ".join(
                cell.rjust(width) if i in self.right else cell.ljust(width)
                for i, (cell, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        ]
        return "\n".join([*([self.title] if self.title else []), *shown])

    def html(self) -> str:
        """A table element; everything in it is escaped."""
        head = "".join(self._cell("th", i, name) for i, name in enumerate(self.columns))
        body = "".join(
            "<tr>" + "".join(self._cell("td", i, cell) for i, cell in enumerate(row)) + "</tr>"
            for row in self.rows
        )
        caption = f"<caption>{html.escape(self.title)}</caption>" if self.title else ""
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def _cell(self, kind: str, column: int, text: str) -> str:
        side = "right" if column in self.right else "left"
        return f'<{kind} style="text-align:{side}">{html.escape(text)}</{kind}>'


Displayable = str | ShownTable


def filled(text: str) -> str:
    """Lines of at most ``WIDTH`` characters; a number and its unit stay together."""
    return textwrap.fill(held_together(text), WIDTH).replace(NO_BREAK, " ")


class Displayed:
    """An object that shows itself: a subclass says in ``_parts`` what there is to see."""

    def _parts(self) -> Sequence[Displayable]:
        raise NotImplementedError

    def __repr__(self) -> str:
        return "\n\n".join(
            part.text() if isinstance(part, ShownTable) else filled(part) for part in self._parts()
        )

    def _repr_html_(self) -> str:
        first, *rest = self._parts()
        head = first.html() if isinstance(first, ShownTable) else f"<p><b>{html.escape(first)}</b></p>"
        return head + "".join(
            part.html() if isinstance(part, ShownTable) else f"<p>{html.escape(part)}</p>" for part in rest
        )


class Figures(Mapping[str, "Figure"]):
    """Matplotlib figures by name. They belong to no pyplot session: change, combine and save them freely."""

    def __init__(self, figures: Mapping[str, Figure]) -> None:
        self._figures = dict(figures)

    def __getitem__(self, name: str) -> Figure:
        return self._figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def __len__(self) -> int:
        return len(self._figures)

    def __repr__(self) -> str:
        return f"{len(self)} figures: {', '.join(self)}"

    def _repr_html_(self) -> str:
        return "".join(
            f"<figure><figcaption>{html.escape(name)}</figcaption>{_svg(figure)}</figure>"
            for name, figure in self._figures.items()
        )

    def save(self, folder: str | Path, kind: str = "png") -> list[Path]:
        """Write every figure into a folder, all or none; returns the files.

        Args:
            kind: ``png``, ``svg`` or ``pdf``.

        Raises:
            UserError: a file is there already, or the folder cannot be written to.
        """
        folder = Path(folder)
        files = [folder / f"{name}.{kind}" for name in self]
        with OutputSet() as outputs:
            outputs.make_folder(folder)
            for path, figure in zip(files, self.values(), strict=True):
                figure.savefig(outputs.claim(path), format=kind)
        return files


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg")
    drawn = text.getvalue()
    return drawn[drawn.index("<svg") :]


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


def opened_each(sources: Sequence[SessionSource]) -> list[Session]:
    """Sessions that are to be judged together.

    Raises:
        UserError: one cannot be read, or two hold the same recording.
    """
    read = [opened(one) for one in sources]
    refuse_twice(read)
    return read


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
    """A fitted model; ``model`` is the content of its file (``fingerlab.models.file.SavedModel``)."""

    def __init__(self, model: SavedModel, name: str = "this model") -> None:
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


def _rows(model: SavedModel) -> list[tuple[str, str]]:
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
        UserError: no session, one that comes twice, an unknown effect, one that does not apply, or a run that
            cannot be read.
    """
    from fingerlab.prediction import fit_extended, model_of_extended

    if not sessions:
        raise UserError("No session was given; name at least one session file.")
    read = opened_each(sessions)
    return ModelView(model_of_extended(fit_extended(read, effect_ids(effects), progress)))


def load_model(path: str | Path) -> ModelView:
    """Read a model file.

    Raises:
        UserError: the file is missing or no model file.
    """
    from fingerlab.models.file import load_model as load

    return ModelView(load(path), str(path))
