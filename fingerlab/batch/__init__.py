"""Many sessions: a folder tree diagnosed in parallel."""
