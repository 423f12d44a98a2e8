"""What every part needs: errors that reach a user, units, text, files, a second process, own files."""
