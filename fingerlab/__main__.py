"""``python -m fingerlab`` does what the command ``fingerlab`` does."""

from fingerlab.cli import main

if __name__ == "__main__":
    main()
