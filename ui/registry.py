"""Which tabs the window has. To add one: write it in a sub-package and add its line here.

The number is the tab's place on the rail and its key, Ctrl+number; it stays the same whichever tabs exist:
1 Acquire, 2 Calibrate, 3 Sessions, 4 Fit, 5 Predict, 6 Model lab.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

from .desk import Desk
from .tab import Tab

TabMaker = Callable[[Desk], Tab]


@dataclass(frozen=True)
class Entry:
    """A tab before it is built.

    Attributes:
        key: by which others name it. title, help: as on the rail. make: builds it.
    """

    number: int
    key: str
    title: str
    help: str
    make: TabMaker


def _later(module: str, name: str) -> TabMaker:
    """Import the tab when it is built: the window opens without waiting for it."""

    def make(desk: Desk) -> Tab:
        maker: TabMaker = getattr(import_module(module, __package__), name)
        return maker(desk)

    return make


TABS: tuple[Entry, ...] = (
    Entry(
        1,
        "acquire",
        "Acquire",
        "Connect a rig, see it live, drive it and record it.",
        _later(".acquire.tab", "AcquireTab"),
    ),
    Entry(
        2,
        "calibrate",
        "Calibrate",
        "Load cell and angle sensors, step by step: volts to units.",
        _later(".calibrate.calibrate_tab", "CalibrateTab"),
    ),
    Entry(
        3,
        "sessions",
        "Sessions",
        "A folder of sessions: find, review, tag, cut, merge and export them.",
        _later(".sessions.sessions_tab", "SessionsTab"),
    ),
    Entry(
        4,
        "fit",
        "Fit",
        "Moment arms, friction losses and delays of the runs on air.",
        _later(".fit.fit_tab", "FitTab"),
    ),
    Entry(
        5,
        "predict",
        "Predict",
        "The endpoint force that models foretell, beside the load cell.",
        _later(".predict.predict_tab", "PredictTab"),
    ),
    Entry(
        6,
        "model_lab",
        "Model lab",
        "Where the model fails, which physical effect is missing, and whether it is true.",
        _later(".lab.model_lab_tab", "ModelLabTab"),
    ),
)
"""In the order of their numbers."""
