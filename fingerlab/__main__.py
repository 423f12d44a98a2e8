"""``python -m fingerlab`` does what the command ``fingerlab`` does."""

import sys
from pathlib import Path

import fingerlab

if not sys.flags.safe_path and Path(sys.path[0]).resolve() != Path(fingerlab.__file__).parents[1]:
    del sys.path[0]  # the current folder: what lies beside a stranger's session is not to be imported

from fingerlab.cli import main

if __name__ == "__main__":
    main()
