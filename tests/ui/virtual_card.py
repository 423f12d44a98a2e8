"""The virtual card of ``tests/devices``, which is no package of this one."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

FOLDER = Path(__file__).parent.parent / "devices" / "virtual_card"
NAME = "virtual_card_of_the_window"

if NAME not in sys.modules:
    _spec = spec_from_file_location(NAME, FOLDER / "__init__.py", submodule_search_locations=[str(FOLDER)])
    assert _spec is not None
    assert _spec.loader is not None
    sys.modules[NAME] = module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules[NAME])

_package = sys.modules[NAME]
Card = _package.Card
DaqFailure = _package.DaqFailure
InProcessChannel = _package.InProcessChannel
Servicer = _package.Servicer
TcpServer = _package.TcpServer
