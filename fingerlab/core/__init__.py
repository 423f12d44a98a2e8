"""What every part needs: errors that reach a user, units, text, files, processes, own files."""
