"""The window. Shows what fingerlab computes and computes nothing itself."""
