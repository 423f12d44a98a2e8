"""The command line: everything that the application does, without a display."""

from fingerlab.cli.main import main

__all__ = ["main"]
