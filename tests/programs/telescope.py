"""An INDI mount the way its user handles it: goto, sync, arrow buttons, stop, park, time and site.

Property and element names are INDI's standard ones.  Right ascension is in hours there and in
degrees here.  Each method waits, in bounded time, until the driver has answered.
"""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from .indi import IndiClient, IndiServer, Vector
from .processes import Workshop
from .product import Endpoint
from .sky import Site, Spot

POLLING = 250
"""Milliseconds between two polls of a driver (INDI's default is 1000)."""
POSITION = "EQUATORIAL_EOD_COORD"
MOTION = {"NORTH": "NS", "SOUTH": "NS", "WEST": "WE", "EAST": "WE"}


def spot_of(vector: Vector) -> Spot:
    """The position an `EQUATORIAL_EOD_COORD` vector tells."""
    return Spot(vector.number("RA") * 15.0, vector.number("DEC"))


class Telescope:
    """One driver process connected to one mount."""

    def __init__(self, workshop: Workshop, driver: str, device: str, mount: Endpoint) -> None:
        self.server = IndiServer(workshop, driver)
        self.client = IndiClient(self.server.port, device)
        workshop.keep(self.client.close)
        client = self.client
        client.set("POLLING_PERIOD", {"PERIOD_MS": str(POLLING)})
        client.switch("DEVICE_AUTO_SEARCH", "INDI_DISABLED")
        if mount.where.startswith("tcp:"):
            client.switch("CONNECTION_MODE", "CONNECTION_TCP")
            client.set("DEVICE_ADDRESS", {"ADDRESS": "127.0.0.1", "PORT": str(mount.port)})
        else:
            client.switch("CONNECTION_MODE", "CONNECTION_SERIAL")
            client.set("DEVICE_PORT", {"PORT": mount.path})
        client.switch("CONNECTION", "CONNECT")
        client.wait_for_vector(POSITION)

    def end(self) -> None:
        """End the driver process, as a user does who closes the program."""
        self.client.close()
        self.server.end()

    def shown(self) -> Spot:
        """The position the driver showed last; drivers tell a position only when it has changed."""
        return spot_of(self.client.vectors[POSITION])

    def busy(self) -> bool:
        """Whether the driver shows a slew under way."""
        return self.client.vectors[POSITION].state == "Busy"

    def _point(self, purpose: str, spot: Spot) -> int:
        self.client.switch("ON_COORD_SET", purpose)
        mark = len(self.client.history)
        self.client.send(POSITION, {"RA": repr(spot.ra / 15.0), "DEC": repr(spot.dec)})
        return mark

    def start_goto(self, spot: Spot) -> int:
        """Send the mount off; the place in the client's history where the slew begins."""
        mark = self._point("TRACK", spot)

        def begun() -> list[str]:
            return [one.state for one in self.client.since(mark, POSITION) if one.state in ("Busy", "Alert")]

        self.client.wait_for(f"slew to {spot} begins", lambda: bool(begun()))
        assert begun()[0] == "Busy", self.client.messages[-3:]
        return mark

    def goto(self, spot: Spot) -> list[Vector]:
        """Slew, and wait until the driver says that it is over. All it showed; the last is the arrival."""
        mark = self.start_goto(spot)
        self.client.wait_for(f"slew to {spot} ends", lambda: not self.busy())
        return self.client.since(mark, POSITION)

    def sync(self, spot: Spot) -> None:
        """Tell the mount that it points there."""
        mark = self._point("SYNC", spot)
        self.client.wait_for("sync", lambda: bool(self.client.since(mark, POSITION)))
        refused = [vector for vector in self.client.since(mark, POSITION) if vector.state == "Alert"]
        assert not refused, self.client.messages[-3:]

    def choose_rate(self, element: str) -> None:
        """Choose the speed of the arrow buttons."""
        self.client.switch("TELESCOPE_SLEW_RATE", element)

    def press(self, direction: str) -> None:
        """Hold an arrow button down: NORTH, SOUTH, WEST or EAST."""
        self.client.switch(f"TELESCOPE_MOTION_{MOTION[direction]}", f"MOTION_{direction}", ("Busy", "Ok"))

    def release(self, direction: str) -> None:
        """Let that button go."""
        name = f"TELESCOPE_MOTION_{MOTION[direction]}"
        self.client.set(name, {f"MOTION_{direction}": "Off"}, ("Idle", "Ok"))

    def abort(self) -> None:
        """Press the red button, and wait until the driver no longer shows a slew."""
        self.client.switch("TELESCOPE_ABORT_MOTION", "ABORT", ("Ok", "Idle"))
        self.client.wait_for("no slew after abort", lambda: not self.busy())

    def choose(self, name: str, element: str, states: Sequence[str] = ("Ok", "Idle", "Busy")) -> None:
        """Turn on one switch of a vector and see that the driver shows it."""
        self.client.switch(name, element, states)
        assert element in self.client.vectors[name].on(), self.client.vectors[name]

    def park(self) -> None:
        """Park, and wait until the driver says that the mount is parked."""
        self.client.switch("TELESCOPE_PARK", "PARK", ("Busy", "Ok"))
        self.client.wait_for("parked", lambda: self.client.vectors["TELESCOPE_PARK"].state in ("Ok", "Alert", "Idle"))
        vector = self.client.vectors["TELESCOPE_PARK"]
        assert vector.state == "Ok" and "PARK" in vector.on(), (vector, self.client.messages[-3:])

    def unpark(self) -> None:
        """Take the mount out of its park state."""
        self.choose("TELESCOPE_PARK", "UNPARK", ("Ok", "Idle"))

    def set_clock(self, moment: datetime.datetime, offset: int) -> None:
        """Tell the mount the Universal Time and the hours that local time is ahead of it."""
        self.client.set("TIME_UTC", {"UTC": moment.strftime("%Y-%m-%dT%H:%M:%S"), "OFFSET": str(offset)})

    def clock(self) -> tuple[datetime.datetime, float]:
        """What the driver read from the mount when it connected: Universal Time, and hours of local time."""
        self.client.wait_for_vector("TIME_UTC")
        self.client.wait_for("clock read", lambda: bool(self.client.vectors["TIME_UTC"].values["UTC"]))
        values = self.client.vectors["TIME_UTC"].values
        moment = datetime.datetime.strptime(values["UTC"], "%Y-%m-%dT%H:%M:%S")
        return moment.replace(tzinfo=datetime.UTC), float(values["OFFSET"])

    def set_site(self, site: Site) -> None:
        """Tell the mount where it stands."""
        values = {"LAT": repr(site.latitude), "LONG": repr(site.longitude % 360.0), "ELEV": "0"}
        self.client.set("GEOGRAPHIC_COORD", values)

    def site(self) -> Site:
        """What the driver read from the mount when it connected."""
        name = "GEOGRAPHIC_COORD"
        self.client.wait_for_vector(name)
        self.client.ask_for_everything()
        self.client.wait_for("site read", lambda: self.client.vectors[name].number("LAT") != 0.0)
        vector = self.client.vectors[name]
        return Site(vector.number("LAT"), (vector.number("LONG") + 180.0) % 360.0 - 180.0)
