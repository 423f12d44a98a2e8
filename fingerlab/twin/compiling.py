"""Compiling the integrator: native code, kept on disk so that only the first start waits for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a numeric function to native code on its first call.

    The code is kept beside the source, or in the user's cache folder where the package is read-only
    (numba looks for both). Where neither can be written, or the source is inside an archive, the
    function is compiled anew in each process: slower to start, same numbers.
    """
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # "no locator available": nowhere to keep the code
        return numba.njit(error_model="numpy")(function)
