"""What tests run in processes of their own; a module that those processes can find by its name."""

from __future__ import annotations

from fingerlab.acquisition.ring import Ring


def row(number: int) -> tuple[float, float, float]:
    """A row of three that tells its number."""
    return (float(number), 2.0 * number, -float(number))


def write_fast(name: str, count: int) -> None:
    """Fill a ring as fast as possible."""
    ring = Ring.attach(name)
    for number in range(count):
        ring.write(row(number))
    ring.close()
