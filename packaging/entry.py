"""Where the packaged program begins: as ``python -m fingerlab`` does."""

import multiprocessing

from fingerlab.cli import main

if __name__ == "__main__":
    multiprocessing.freeze_support()  # a spawned worker of a packaged program starts here too
    main()
