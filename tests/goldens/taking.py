"""What is asked of a session: commands as a user gives them, and the sums behind the diagnosis.

All commands run in an empty folder that holds a copy of the session, so that no answer names a place of a
machine.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.goldens.calling import call, lasting, words
from tests.goldens.items import Item
from tests.goldens.report import page, paper

VARIANTS = (("regions", "xcorr"), ("regions", "findsignal"), ("flexion-extension", "none"), ("whole", "none"))
"""Methods and delays of ``fit`` beside its own choice."""
WANTED = {"kind": "sine", "mean_n": 1.0, "amplitude_n": 0.4, "frequency_hz": 0.5, "duration_s": 4.0}


def take(item: Item, paths: Sequence[Path], steps: Sequence[str]) -> tuple[dict[str, Any], dict[str, float]]:
    """The answers by step, and the seconds that each step took."""
    answers, seconds = {}, {}
    with _folder_of_copies(paths) as (folder, names):
        asked = _Asked(item, folder, names)
        for step in steps:
            started = time.perf_counter()
            answers[step] = STEPS[step](asked)
            seconds[step] = round(time.perf_counter() - started, 2)
    return answers, seconds


@contextmanager
def _folder_of_copies(paths: Sequence[Path]) -> Iterator[tuple[Path, list[str]]]:
    before = Path.cwd()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:  # Windows keeps what is open
        folder = Path(name).resolve()
        for path in paths:
            shutil.copyfile(path, folder / path.name)
        os.chdir(folder)
        try:
            yield folder, [path.name for path in paths]
        finally:
            os.chdir(before)


class _Asked:
    """One session while it is asked: its files, and the models that earlier steps left."""

    def __init__(self, item: Item, folder: Path, names: list[str]) -> None:
        self.item = item
        self.folder = folder
        self.names = names
        self.first = names[0]
        self._said: dict[str, Any] | None = None

    def answer(self, *arguments: str, files: Sequence[str] = ()) -> dict[str, Any]:
        """Exit code, JSON and print of a command, and the JSON ``files`` that it wrote."""
        out = self.folder / "out.json"
        out.unlink(missing_ok=True)
        done = call(*arguments, "--json", out.name)
        found: dict[str, Any] = {"code": done.code}
        if done.code != 0:
            return {**found, "errors": words(done.errors, [self.folder]).splitlines()}
        found["json"] = self.lasting(out)
        found["printed"] = words(done.printed, [self.folder]).splitlines()
        return found | {name: self.lasting(self.folder / name) for name in files}

    def lasting(self, path: Path) -> Any:
        return lasting(json.loads(path.read_text(encoding="utf-8")), [self.folder])

    def diagnosed(self) -> dict[str, Any]:
        """``diagnose --save``; asked once."""
        if self._said is None:
            self._said = self.answer("diagnose", *self.names, "--save", "found.json", files=["found.json"])
        return self._said

    def model(self) -> str | None:
        """The model that the diagnosis ends at; None: there is none."""
        return "found.json" if self.diagnosed()["code"] == 0 else None


def _info(asked: _Asked) -> Any:
    return asked.answer("info", asked.first)


def _fit(asked: _Asked) -> Any:
    """The fit, and the force that its model predicts."""
    return _fitted(asked, "regions", "none")


def _fitted(asked: _Asked, method: str, delay: str) -> Any:
    model = f"{method}-{delay}.json"
    words_ = ("--method", method, "--delay", delay, "--model", model)
    fitted = asked.answer("fit", asked.first, *words_)
    if fitted["code"] != 0:
        return {"fit": fitted}
    fitted["model"] = asked.lasting(asked.folder / model)
    return {"fit": fitted, "predict": asked.answer("predict", asked.first, "--model", model)}


def _variants(asked: _Asked) -> Any:
    return {f"{method}, {delay}": _fitted(asked, method, delay) for method, delay in VARIANTS}


def _with_model(asked: _Asked, command: str, *more: str) -> Any:
    model = asked.model()
    if model is None:
        return {"code": asked.diagnosed()["code"], "errors": ["there is no model"]}
    return asked.answer(command, asked.first, "--model", model, *more)


def _inverse(asked: _Asked) -> Any:
    said = _with_model(asked, "inverse", "--wanted", json.dumps(WANTED), "--out", "needed.json")
    if said["code"] == 0:
        said["trajectory"] = asked.lasting(asked.folder / "needed.json")
    return said


def _added(asked: _Asked) -> Any:
    """The diagnosis with the best candidate in the model already."""
    said = asked.diagnosed()
    if said["code"] != 0 or not said["json"]["candidates"]:
        return {"code": said["code"], "errors": ["there is nothing to add"]}
    return asked.answer("diagnose", *asked.names, "--add", said["json"]["candidates"][0]["effect"])


def _report(asked: _Asked) -> Any:
    done = call(
        *("report", *asked.names, "--out", "page.html", "--pdf", "page.pdf"),
        *("--equation", "equation.md", "--json", "report.json"),
    )
    if done.code != 0:
        return {"code": done.code, "errors": words(done.errors, [asked.folder]).splitlines()}
    equation = (asked.folder / "equation.md").read_text(encoding="utf-8")
    return {
        "json": asked.lasting(asked.folder / "report.json"),
        "page": page((asked.folder / "page.html").read_text(encoding="utf-8"), asked.folder),
        "paper": paper(asked.folder / "page.pdf", asked.folder),
        "equation": words(equation, [asked.folder]).splitlines(),
    }


def _sums(asked: _Asked) -> Any:
    from tests.goldens.inside import sums_and_noises  # the one module that knows the inside of the program

    return sums_and_noises([asked.folder / name for name in asked.names])


def _left_out(asked: _Asked) -> Any:
    from tests.goldens.inside import diagnosis_without

    return lasting(diagnosis_without([Path(n) for n in asked.names], asked.item.left_out), [asked.folder])


STEPS: dict[str, Callable[[_Asked], Any]] = {
    "info": _info,
    "diagnose": _Asked.diagnosed,
    "sums": _sums,
    "fit": _fit,
    "predict": lambda asked: _with_model(asked, "predict"),
    "compare": lambda asked: _with_model(asked, "compare"),
    "inverse": _inverse,
    "added": _added,
    "variants": _variants,
    "report": _report,
    "left_out": _left_out,
}
"""What can be asked, by name."""
