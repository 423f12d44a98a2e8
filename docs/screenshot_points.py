"""Which pictures stand for the points of the window, and the states that no tab's tutorial needs.

The walk of a day: what cannot be done yet and a file that is none, a model of two effects built, the session
closed and opened again, its project found as it was left and its report saved.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from click.testing import CliRunner
from PySide6.QtWidgets import QFileDialog
from screenshot_states import add_best, opened_in_lab, pause, tell_truth, wait_until

from fingerlab.cli.main import cli
from fingerlab.ui.app.window import MainWindow

POINTS = {
    "model-lab-figure": "01-figure",
    "walk-project": "02-project",
    "model-lab-empty": "03-first-page",
    "model-lab-side-by-side": "04-side-by-side",
    "model-lab-spectrum": "05-closer",
    "model-lab-parameters": "06-parameters",
    "predict-cursors": "07-readouts",
    "walk-report": "08-report",
    "sessions-trend": "09-batch",
    "import-columns": "10-import",
    "help-glossary": "11-help",
    "walk-refused": "12-finish",
    "model-lab-practice-revealed": "13-practice",
}
"""By tab and state: the picture's name in ``points``, where it is kept in both themes and every size."""
ELSEWHERE = {
    "acquire-running": ("dark-1920", "2x"),
    "calibrate-hold": ("dark-1920",),
    "sessions-review": ("dark-1920",),
    "fit": ("dark-1920", "dark-2x"),
    "predict": ("dark-1920", "2x"),
    "model-lab": ("dark-1920",),
    "model-lab-where": ("dark-2x",),
}
"""Theme and size of those that a page shows besides."""
SEED = 5


def walk_states(window: MainWindow, folder: Path) -> Iterator[str]:
    """A refused file beside a menu's disabled entries; a project come back; its report saved."""
    window.show_tab("model_lab")
    Path("notes.h5").write_text("no session", encoding="utf-8")
    window.open_paths([Path("notes.h5")])
    pause(100)
    wait_until(lambda: not window.tasks.busy)
    menu = window.menus.tab_menu
    menu.popup(window.mapToGlobal(window.menuBar().actionGeometry(menu.menuAction()).bottomLeft()))
    yield "refused"
    menu.close()
    window.context.hush()
    tab = opened_in_lab(window, session := two_effects(Path("bench.h5")))
    for _ in range(2):
        add_best(window, tab)
    window.close_session()
    pause(100)
    yield "project"
    opened_in_lab(window, session)
    tab.view.go_to("true")
    tell_truth("walk", tab)
    QFileDialog.getSaveFileName = lambda *_: ("bench.html", "")  # type: ignore[method-assign,assignment]
    tab.save_report()
    wait_until(lambda: not window.tasks.busy)
    pause(100)
    yield "report"


def two_effects(path: Path) -> Path:
    """A session of the simulated rig whose cable stretches and whose joints rub."""
    effects = ["--effect", "cable_stretch", "--effect", "coulomb_friction"]
    asked = ["simulate", "--protocol", "rich", *effects, "--seed", str(SEED), "--out", str(path)]
    done = CliRunner().invoke(cli, asked)
    assert done.exit_code == 0, done.output
    return path
