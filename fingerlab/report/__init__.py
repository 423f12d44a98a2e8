"""report"""

import contextlib
from pathlib import Path

if Path("matplotlibrc").exists():  # that of the current folder, which may be a stranger's, would come first
    with contextlib.chdir(Path(__file__).parent):
        import matplotlib  # noqa: F401
