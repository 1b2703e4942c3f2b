"""Parses and writes RMC sentences of a GPS receiver (NMEA 0183). They contain position, UTC date and time."""

from __future__ import annotations

from datetime import UTC, datetime

from gateway.core.operations import Gps, Place


def parse_fix(sentence: str) -> Gps | None:
    """Parse an RMC sentence; ``linked`` is False without a fix. Return None if it is of another type or garbled."""
    import pynmea2

    try:
        parsed = pynmea2.parse(sentence.strip(), check=True)
        if parsed.sentence_type != "RMC":
            return None
        if not parsed.is_valid:
            return Gps(linked=False)
        unix = datetime.combine(parsed.datestamp, parsed.timestamp.replace(tzinfo=UTC)).timestamp()
        return Gps(True, Place(parsed.latitude, parsed.longitude), unix)
    except (pynmea2.ParseError, AttributeError, TypeError, ValueError):
        return None


def format_rmc(place: Place | None, unix: float, has_fix: bool = True) -> str:
    """Return an RMC sentence with its checksum; without a position if ``place`` is None. ``unix`` is in seconds."""
    import pynmea2

    now = datetime.fromtimestamp(unix, UTC)
    places = ("",) * 4 if place is None else (*_to_nmea(place.latitude, 2, "NS"), *_to_nmea(place.longitude, 3, "EW"))
    status = "A" if has_fix else "V"
    return str(
        pynmea2.RMC(
            "GP", "RMC", (now.strftime("%H%M%S"), status, *places, "0.0", "0.0", now.strftime("%d%m%y"), "", "")
        )
    )


def _to_nmea(degrees: float, digits: int, letters: str) -> tuple[str, str]:
    """Return degrees and minutes (to a thousandth) without a separator, and the letter of the hemisphere."""
    whole, minutes = divmod(round(abs(degrees) * 60000), 60000)
    return f"{whole:0{digits}d}{minutes / 1000:06.3f}", letters[degrees < 0]
