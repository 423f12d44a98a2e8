"""``python -m fingerlab.ui [SESSION.h5 ...]`` opens the window with those sessions."""

import sys

from .app.application import run

sys.exit(run(sys.argv[1:]))
