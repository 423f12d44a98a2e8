"""Start FingerLab: ``python start.py`` opens it, ``python start.py test`` runs its tests.

Both first make ``.venv`` and install the locked dependencies where that is not done yet. This file
keeps to syntax that every Python reads, so that a Python that is too old gets a sentence and not a
syntax error; the work is in ``packaging/bootstrap``, which needs the standard library only.
"""

import os
import sys

OLDEST = (3, 11)

if sys.version_info < OLDEST:
    sys.stderr.write(
        "FingerLab needs Python %s.%s or newer, and this is Python %s.%s (%s); "
        "install a newer one from python.org and start again with it.\n"
        % (OLDEST + tuple(sys.version_info[:2]) + (sys.executable,))
    )
    sys.exit(1)

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "packaging"))

if __name__ == "__main__":
    from bootstrap.launcher import main

    sys.exit(main(sys.argv[1:]))
