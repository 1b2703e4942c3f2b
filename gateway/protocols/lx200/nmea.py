"""The sentence of a GPS receiver, made from a place and an instant."""

from __future__ import annotations

from datetime import UTC, datetime


def rmc(latitude: float, longitude: float, unix: float) -> str:
    """An RMC sentence with its checksum: position to a thousandth of an arcminute (east positive), time in UT."""
    import pynmea2

    now = datetime.fromtimestamp(unix, UTC)
    places = (*_angle(latitude, 2, "NS"), *_angle(longitude, 3, "EW"))
    return str(pynmea2.RMC("GP", "RMC", (now.strftime("%H%M%S"), "A", *places, "0.0", "0.0", now.strftime("%d%m%y"),
                                         "", "")))


def _angle(degrees: float, digits: int, letters: str) -> tuple[str, str]:
    """Degrees and minutes run together, and the letter of the hemisphere."""
    whole, minutes = divmod(round(abs(degrees) * 60000), 60000)
    return f"{whole:0{digits}d}{minutes / 1000:06.3f}", letters[degrees < 0]
