"""A simulated Meade as it is: what it was told, what it knows, how its motors turn. Nothing here knows a command.

What it knows is what the manual gives that model, and what real ones were seen to know. The classics and the Autostar
begin in low precision, the LX200GPS in high.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gateway.astro.axes import Build, Pair, Sky
from gateway.astro.spherical import SIDEREAL_RATE, fold_declination, wrap180
from gateway.core.errors import UserError
from gateway.core.operations import Values
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: Beyond the manual, yet known to these; other forms beyond it are known to none.
BEYOND = {
    "Mg": {"autostar", "lx200gps"}, "GW": {"autostar", "lx200gps"}, "GVF": {"autostar"}, "hI": {"lx200gps"},
    "TS": {"autostar", "lx200", "lx200-16", "lx200gps"}, "R": {"autostar", "lx200gps"},
}  # fmt: skip
#: A classic has no name to tell.
NAMELESS = {"GVP", "GVN", "GVD", "GVT", "GVF"}
STARTS_HIGH = {"lx200gps"}
SITES = 4


class Telescope(Simulated):
    """One simulated telescope. ``site`` is latitude and longitude east in degrees, ``utc_offset`` local minus UTC.

    ``clock`` gives Unix seconds and is the only source of time. The motors gather and lose speed as real ones do; with
    ``ramps`` False they change it at once, for whoever reckons with plain rates. Raises UserError for a model that does
    not exist.
    """

    def __init__(
        self,
        model: str = "autostar",
        *,
        clock: Callable[[], float],
        site: Pair = (45.0, 10.0),
        utc_offset: float = 0.0,
        aligned: bool = True,
        speed: float = 1.0,
        land_tells_altaz: bool = False,
        tolerant: bool = False,
        ramps: bool = True,
    ) -> None:
        self.protocol = load("lx200")
        if model not in self.protocol.models:
            raise UserError(f"no LX200 model is called {model!r}; there are {', '.join(self.protocol.models)}")
        self.model: str = model
        self.row: Model = self.protocol.models[model]
        self.classic: bool = model in ("lx200", "lx200-16")
        self.clock, self.now = clock, clock()
        self.sites: list[Pair] = [site] * SITES
        self.names = [f"SITE {number}" if not self.classic else f"ST{number}" for number in range(1, SITES + 1)]
        self.site_number = 0
        self.ahead, self.offset = 0.0, utc_offset
        self.aligned: bool = aligned
        self.letter: str = "P" if self.classic else "A"
        #: Where a slew goes, and whether that is axis positions instead of a place on the sky.
        self.goal: tuple[Pair, bool] = (0.0, 0.0), False
        #: Axes moved by hand, and whether that only adds to what the motor does anyway.
        self.arrows: dict[int, bool] = {}
        self.busy_until = 0.0
        self.seeking, self.home = False, 0
        self.land_tells_altaz, self.tolerant = land_tells_altaz, tolerant
        build = Build.WEDGE if self.letter == "P" else Build.ALTAZ
        self.mechanics = Mechanics(build, Sky(*site), self.now, self.start(build))
        self.mechanics.speed = speed
        self.mechanics.acceleration = self.row["max_rate"] / RAMP_SECONDS if ramps else math.inf
        self.power_on()

    def power_on(self) -> None:
        """Formats, rates and target as they are after switching on; site, clock and names are remembered."""
        self.high: bool = self.model in STARTS_HIGH
        self.parts: dict[str, Any] = {}
        self.kept: dict[str, Any] = {"rate": "RC", "lowest": 0.0, "highest": 90.0}
        self.mechanics.fastest = float(self.row["max_rate"])
        self.mechanics.keep_up_with(self.now, SIDEREAL_RATE)
        self.parked = self.asleep = False
        self.track(self.aligned)

    def supports(self, name: str) -> bool:
        """Whether this model has a command: by the manual, else by what real ones do."""
        command = self.protocol.commands[name]
        if command.beyond:
            return self.model in BEYOND.get(name, ())
        if name in NAMELESS and self.classic:
            return False
        return command.known_to(self.model, None)

    # --- what it is -----------------------------------------------------------------------------------------------

    @property
    def site(self) -> Pair:
        """Latitude and longitude east of the site that is selected."""
        return self.sites[self.site_number]

    @property
    def busy(self) -> bool:
        """Whether the telescope hears hardly anything: seeking home, calculating, waiting for satellites."""
        return self.seeking or self.now < self.busy_until

    def utc(self) -> float:
        """The telescope's own clock, Unix seconds."""
        return self.now + self.ahead

    def start(self, build: Build) -> Pair:
        """Axes at power-on: on the meridian, half way up or on the equator."""
        return (180.0 if self.site[0] >= 0 else 0.0), (0.0 if build is Build.WEDGE else 45.0)

    def track(self, on: bool) -> None:
        """Follow the sky, or stand still: asleep it can only do the latter."""
        self.mechanics.track(self.now, on and not self.asleep, self.mechanics.geometry.pole)

    def forget(self) -> None:
        """Lose the alignment: the tube is taken to stand where it should at power-on."""
        first, second = self.mechanics.axes(self.now)
        there = self.start(self.mechanics.build)
        self.mechanics.correct(self.now, (wrap180(there[0] - first), wrap180(there[1] - second)))
        self.aligned = False

    def relocate(self) -> None:
        """After a new site or time."""
        self.mechanics.relocate(self.now, Sky(*self.site, self.ahead))

    def position(self) -> Pair:
        """Right ascension and declination of date, as the telescope believes."""
        return fold_declination(*self.mechanics.believed(self.now))

    def come_to_now(self) -> None:
        """Let time pass: motion, and the end of a search for home."""
        self.now = self.clock()
        self.mechanics.advance(self.now)
        if self.seeking and not self.mechanics.slewing(self.now):
            self.seeking, self.home, self.aligned = False, 1, True
            self.mechanics.correct(self.now, (0.0, 0.0))


#: Answers a command: (telescope, its name, its values) -> the reply, or None.
Handler = Callable[[Telescope, str, Values], bytes | None]
