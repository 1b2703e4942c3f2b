"""The GPS of an LX200GPS: sentences made from the site and the clock in force."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from gateway.operations import ClockFromGps, GetClock, GetSite, Moment, Place
from gateway.surface import Handling, Session
from gateway.tables import Command


def sentence(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:gps - one RMC sentence, position to a thousandth of an arcminute, time in UT."""
    import pynmea2

    place: Place = yield GetSite()
    moment: Moment = yield GetClock()
    now = datetime.fromtimestamp(moment.unix, UTC)
    fields = (now.strftime("%H%M%S"), "A", *_angle(place.latitude, 2, "NS"), *_angle(place.longitude, 3, "EW"),
              "0.0", "0.0", now.strftime("%d%m%y"), "", "")
    return {"text": str(pynmea2.RMC("GP", "RMC", fields))}


def _angle(degrees: float, digits: int, letters: str) -> tuple[str, str]:
    """Degrees and minutes run together, and the letter of the hemisphere."""
    thousandths = round(abs(degrees) * 60000)
    whole, minutes = divmod(thousandths, 60000)
    return f"{whole:0{digits}d}{minutes / 1000:06.3f}", letters[degrees < 0]


def set_clock(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:gT - 1 when the mount's clock was set from its GPS unit, 0 when there is none or it has no fix."""
    yield ClockFromGps()
