"""What ``start.py`` does before FingerLab can run: standard library only, no third-party import."""
