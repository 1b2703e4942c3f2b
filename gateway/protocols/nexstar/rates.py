"""How fast a hand control moves at its keys 1 to 9, by the table of its family: ``mappings/nexstar/rates.toml``.

The drives of its motors have codes of their own among the variable rates.
"""

from __future__ import annotations

from functools import cache

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: Degrees a second.
SIDEREAL = SIDEREAL_ARCSECONDS / 3600.0
#: Variable rates that are none: the motor follows the sky at its own rate of that name.
DRIVE_CODES = {"sidereal": 0xFFFF, "solar": 0xFFFE, "lunar": 0xFFFD}


@cache
def rate_tables() -> dict[str, Model]:
    """The tables by their names, read once."""
    tables: dict[str, Model] = load("nexstar").extra("rates.toml")
    return tables


def key_speed(rates: Model, key: int) -> float:
    """Degrees a second at a key."""
    sidereal, degrees = rates["sidereal"], rates["degrees"]
    if key <= len(sidereal):
        return float(sidereal[key - 1]) * SIDEREAL
    return float(degrees[key - len(sidereal) - 1])
