"""What a reader of a bundle can find out of where its mount stands: every site that comes to mind."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gateway.app.recording.format import read
from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import hour_angle_to_horizon, separation, wrap180
from gateway.core.requests import Goto, Spot, decode
from gateway.diagnostics.prove.elsewhere import site_of
from gateway.diagnostics.prove.gotos import HOUR_ANGLES


def recovered(path: Path, model: str = "") -> list[tuple[float, float]]:
    """Every site that a reader of the recording can think of: what is told, and what the goals of gotos tell."""
    recording = read(path)
    config = recording.settings["config"]["mount"]
    found = [tuple(config["site"])] if config.get("site") else []
    told, _ = site_of(recording, model)
    found += [told] if told else []
    states = 0
    began = recording.settings["began"]
    for event in recording:
        if (
            event.arrow == "c"
            and isinstance(goto := decode(event.data.decode()), Goto)
            and isinstance(goto.where, Spot)
        ):
            for hour_angle in HOUR_ANGLES:  # the first goto may have been to a place that was chosen by the site
                longitude = goto.where.ra + hour_angle - sidereal_time(began + event.at, 0.0)
                found.append((2.0 * goto.where.dec, wrap180(longitude)))
        if event.side == "mount" and event.arrow == "<" and b"UTCDate" in event.data and states < 3:
            states += 1
            found.append(_by_state({one["Name"]: one["Value"] for one in json.loads(event.data)}))
    return [(latitude, longitude) for latitude, longitude in found if abs(latitude) <= 90.0]


def _by_state(state: dict[str, Any]) -> tuple[float, float]:
    """Return the site at which a server's altitude, azimuth, position, sidereal time and clock fit each other."""
    unix = datetime.fromisoformat(state["UTCDate"][:19]).replace(tzinfo=UTC).timestamp()
    hour_angle, dec = 15.0 * (state["SiderealTime"] - state["RightAscension"]), state["Declination"]

    def off(latitude: float) -> float:
        return separation(*hour_angle_to_horizon(hour_angle, dec, latitude), state["Azimuth"], state["Altitude"])

    latitude = min((n / 20.0 for n in range(-1800, 1801)), key=off)
    return latitude, wrap180(15.0 * state["SiderealTime"] - sidereal_time(unix, 0.0))
