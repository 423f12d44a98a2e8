"""FingerLab: the instrument behind the window.

This package measures, stores, models and decides; it never imports Qt. The window lives in
``fingerlab.ui`` and only shows what is computed here.
"""

__version__ = "0.1.0"
