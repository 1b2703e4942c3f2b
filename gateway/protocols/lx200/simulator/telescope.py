"""The state and the mechanics of a simulated Meade; its commands are handled in the other modules of this folder.

It has the commands that the manual gives its model, and those that real telescopes were seen to have. The classics and
the Autostar begin in low precision, the LX200GPS in high.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gateway.astro.axes import Build, Observer, Pair
from gateway.astro.spherical import SIDEREAL_RATE, fold_declination, wrap180
from gateway.core.errors import UserError
from gateway.core.operations import Values
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: Commands beyond the manual, and the models that have them; no model has any other command beyond the manual.
MODELS_BY_COMMAND = {
    "Mg": {"autostar", "lx200gps"}, "GW": {"autostar", "lx200gps"}, "GVF": {"autostar"}, "hI": {"lx200gps"},
    "TS": {"autostar", "lx200", "lx200-16", "lx200gps"}, "R": {"autostar", "lx200gps"},
}  # fmt: skip
#: The commands for the telescope's name, which a classic does not have.
NAME_COMMANDS = {"GVP", "GVN", "GVD", "GVT", "GVF"}
HIGH_PRECISION_MODELS = {"lx200gps"}
SITE_COUNT = 4


class MeadeTelescope(Simulated):
    """One simulated telescope.

    ``site`` is latitude and longitude, degrees, north and east positive; ``utc_offset`` is local time minus UTC, hours.
    ``clock`` returns Unix seconds and is the only source of time. ``speed`` is a factor for the speed of gotos. Without
    ``ramps`` the motors change speed at once, for tests with constant rates. Raises UserError for an unknown model.
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
        self.protocol = load("lx200").in_dialect_of(model)
        if model not in self.protocol.models:
            raise UserError(f"no LX200 model is called {model!r}; there are {', '.join(self.protocol.models)}")
        self.model: str = model
        self.facts: Model = self.protocol.models[model]
        self.classic: bool = model in ("lx200", "lx200-16")
        self.clock, self.now = clock, clock()
        self.sites: list[Pair] = [site] * SITE_COUNT
        self.names = [f"SITE {number}" if not self.classic else f"ST{number}" for number in range(1, SITE_COUNT + 1)]
        self.site_number = 0
        self.clock_ahead, self.utc_offset = 0.0, utc_offset  # its own clock minus ``clock``, seconds; and hours
        self.aligned: bool = aligned
        dialect = bool(self.protocol.dialect)
        self.mode_letter: str = "P" if self.classic else "G" if dialect else "A"
        #: The goal of a slew, and whether it is in axis positions instead of right ascension and declination.
        self.goal: tuple[Pair, bool] = (0.0, 0.0), False
        #: Axes moved by hand, and whether that motion is added to tracking instead of replacing it.
        self.arrows: dict[int, bool] = {}
        self.busy_until = 0.0
        self.seeks_home, self.home_state = False, 0
        self.land_tells_altaz, self.tolerant = land_tells_altaz, tolerant
        build = Build.GERMAN if dialect else Build.WEDGE if self.mode_letter == "P" else Build.ALTAZ
        self.mechanics = Mechanics(build, Observer(*site), self.now, self.power_on_axes(build))
        self.mechanics.speedup = speed
        self.mechanics.acceleration = self.facts["max_rate"] / RAMP_SECONDS if ramps else math.inf
        self.power_on()

    def power_on(self) -> None:
        """Reset formats, rates and target as at power-on; site, clock and names are kept."""
        self.high_precision: bool = self.model in HIGH_PRECISION_MODELS
        self.degree = b"\xdf"
        self.accessories: dict[str, Any] = {}
        self.stored_values: dict[str, Any] = {"rate": "RC", "lowest": 0.0, "highest": 90.0}
        self.mechanics.max_rate = float(self.facts["max_rate"])
        self.mechanics.set_drive_rate(self.now, SIDEREAL_RATE)
        self.parked = self.asleep = False
        self.track(self.aligned)

    def supports(self, name: str) -> bool:
        """Whether this model has a command, according to the manual or to real telescopes."""
        command = self.protocol.commands[name]
        if command.beyond:
            return self.model in MODELS_BY_COMMAND.get(name, ())
        if name in NAME_COMMANDS and self.classic:
            return False
        return command.exists_on(self.model, None)

    # --- what it is -----------------------------------------------------------------------------------------------

    @property
    def site(self) -> Pair:
        """Latitude and longitude (east positive) of the selected site, degrees."""
        return self.sites[self.site_number]

    @property
    def busy(self) -> bool:
        """Whether the telescope accepts hardly any command: it seeks its home, computes, or waits for satellites."""
        return self.seeks_home or self.now < self.busy_until

    def utc(self) -> float:
        """Return the time of the telescope's own clock, Unix seconds."""
        return self.now + self.clock_ahead

    def power_on_axes(self, build: Build) -> Pair:
        """Return the axis positions at power-on: at the pole (German), on the meridian at dec 0 (wedge) or 45° up."""
        if build is Build.GERMAN:
            return 90.0, 90.0
        return (180.0 if self.site[0] >= 0 else 0.0), (0.0 if build is Build.WEDGE else 45.0)

    def track(self, on: bool) -> None:
        """Turn tracking on or off; asleep it stays off."""
        self.mechanics.track(self.now, on and not self.asleep, self.mechanics.geometry.pole_sign)

    def lose_alignment(self) -> None:
        """Lose the alignment: the telescope assumes that the tube is at its power-on position."""
        first, second = self.mechanics.axes(self.now)
        start = self.power_on_axes(self.mechanics.build)
        self.mechanics.correct(self.now, (wrap180(start[0] - first), wrap180(start[1] - second)))
        self.aligned = False

    def relocate(self) -> None:
        """Apply a new site or time to the mechanics."""
        self.mechanics.relocate(self.now, Observer(*self.site, self.clock_ahead))

    def position(self) -> Pair:
        """Return right ascension and declination of date according to the telescope's alignment, degrees."""
        return fold_declination(*self.mechanics.believed_position(self.now))

    def advance_to_now(self) -> None:
        """Advance the motion, and a search for home, to the present time."""
        self.now = self.clock()
        self.mechanics.advance(self.now)
        if self.seeks_home and not self.mechanics.slewing(self.now):
            self.seeks_home, self.home_state, self.aligned = False, 1, True
            self.mechanics.correct(self.now, (0.0, 0.0))


#: Handles a command: (telescope, name, values) -> the reply, or None.
Handler = Callable[[MeadeTelescope, str, Values], bytes | None]
