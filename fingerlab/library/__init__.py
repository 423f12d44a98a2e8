"""A folder tree of session files: what is in it, found again, looked through, noted, cut and merged."""
