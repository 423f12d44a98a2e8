"""The Sessions tab: a folder tree of sessions, and the review of their runs."""
