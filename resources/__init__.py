"""Data files of the application."""
