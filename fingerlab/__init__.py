"""FingerLab: the instrument behind the window.

This package measures, stores, models and decides; it never imports Qt. The window lives in
``fingerlab.ui`` and only shows what is computed here.

In a script or a notebook ``import fingerlab`` gives sessions, diagnoses and models as objects that print
what they hold (``fingerlab.notebook``)::

    session = fingerlab.open("session.h5")
    session.to_xarray()
    session.diagnose()

Nothing heavy is imported before it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

__all__ = ["UserError", "__version__", "catalogue", "diagnose", "fit", "load_model", "open", "simulate"]

_HOMES = {
    "UserError": "fingerlab.core.errors",
    "open": "fingerlab.notebook.session",
    "simulate": "fingerlab.notebook.session",
    "diagnose": "fingerlab.notebook.diagnosis",
    "catalogue": "fingerlab.notebook.diagnosis",
    "fit": "fingerlab.notebook.model",
    "load_model": "fingerlab.notebook.model",
}
"""Where what ``import fingerlab`` offers lives; imported when it is asked for."""

if TYPE_CHECKING:
    from fingerlab.core.errors import UserError
    from fingerlab.notebook.diagnosis import catalogue, diagnose
    from fingerlab.notebook.model import fit, load_model
    from fingerlab.notebook.session import open, simulate
else:

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module 'fingerlab' has no attribute {name!r}")
        value = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
