"""State of a simulated mount and its hand control: settings, motors, devices on the bus. Commands: ``commands.py``.

What the manual does not say is simulated like this:

- A SynScan up to the version ``restarts`` goes on with a goto a second after ``M``, unless both axes get rate 0 first.

- Hand motion overrides tracking. When it ends, tracking stays suspended until ``T``, the end of a goto, or
  until the hand control restores it: after 20 s without a byte from the port, on alt-az mounts at the latest
  30 s after the motion began. Stopping an axis that is not moved by hand changes nothing.
- The mount uses the site and clock that a client has set; its GPS unit keeps the true position and time.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from msgspec import Struct

from gateway.astro.axes import Build, Observer, Pair
from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.core.errors import UserError
from gateway.core.operations import Values
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.nexstar.versions import STARSENSE, modes_by_code, parse
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model, Version, parse_version

#: Carries out a command. Returns the values of its reply, or None if the device does not have the command.
Handler = Callable[["SimulatedMount", Values], Values | None]
OFF, ALTAZ, EQ_NORTH, EQ_SOUTH = range(4)
AZM, ALT, FOCUSER = 16, 17, 18
GPS, RTC = 176, 178
#: The hand control restores tracking after so many seconds without a byte, or of motion on an alt-az mount.
QUIET_BEFORE_RESTORE, MAX_ALTAZ_SUSPENSION = 20.0, 30.0
#: After so many seconds an old SynScan goes on with a goto that only ``M`` has ended.
GOTO_RESTART_DELAY = 1.0
GERMAN_START_AXES: Pair = (90.0, 90.0)


class RestartableGoto(Struct):
    """The last goto of a hand control that resumes gotos after ``M``: its goal in degrees, when ``M`` came, and in
    ``axes_not_stopped`` the axes that have had no rate 0 since then.
    """

    ra: float
    dec: float
    cancelled_at: float = math.inf
    axes_not_stopped: frozenset[int] = frozenset({1, 2})


class FocuserMotor:
    """A focuser: a position in steps; it moves at a rate, to one end of its travel or to a goal."""

    TRAVEL_STEPS = 50000
    MAX_RATE = 1000.0  # steps a second at key 9

    def __init__(self) -> None:
        self._position, self._moved_at, self._rate, self._goal = self.TRAVEL_STEPS / 2, 0.0, 0.0, 0.0

    def position(self, now: float) -> float:
        """Return the steps from the inner end."""
        moved, left = self._rate * (now - self._moved_at), self._goal - self._position
        return self._goal if abs(moved) >= abs(left) else self._position + moved

    def is_moving(self, now: float) -> bool:
        return self._rate != 0.0 and self.position(now) != self._goal

    def move_to(self, now: float, goal: float, rate: float = MAX_RATE) -> None:
        """Move to a position in steps at a rate in steps a second; rate 0 stops."""
        self._position, self._moved_at = self.position(now), now
        self._goal = max(0.0, min(float(self.TRAVEL_STEPS), goal)) if rate else self._position
        self._rate = abs(rate) if self._goal > self._position else -abs(rate)


class SimulatedMount(Simulated):
    """A simulated mount and its hand control. ``site`` is latitude and longitude east, degrees; ``utc_offset`` hours.

    ``clock`` returns Unix seconds and is the only source of time. ``version`` is written as in the manual, or like
    ``starsense-1.20``; the default is the newest of the model, with ``starsense`` that of the StarSense. ``wedge`` puts
    a fork on a wedge. ``speed`` is a factor for the speed of gotos. Without ``ramps`` the motors change speed at once,
    for tests with constant rates. Raises UserError for an unknown model or an invalid version.
    """

    def __init__(
        self,
        model: str = "6-8se",
        version: str | None = None,
        *,
        clock: Callable[[], float],
        site: Pair = (45.0, 10.0),
        utc_offset: float = 0.0,
        aligned: bool = True,
        speed: float = 1.0,
        wedge: bool = False,
        focuser: bool = False,
        starsense: bool = False,
        ramps: bool = True,
    ) -> None:
        protocol = load("nexstar")
        if model not in protocol.models:
            raise UserError(f"no NexStar model is called {model!r}; there are {', '.join(protocol.models)}")
        self.facts: Model = protocol.models[model]
        self._set_version(version, starsense)
        self.model, self.command_set = model, protocol
        self.clock, self.now = clock, clock()
        self.last_byte_at = self.now
        rates = protocol.extra_table("rates.toml")[self.facts["rates"]]
        self.key_speeds = [*(times * SIDEREAL_RATE for times in rates["sidereal"]), *rates["degrees"]]
        self.firmware = parse_version(self.facts["motors"])
        self.settings: dict[tuple[str, int], int] = {}
        self.focuser = FocuserMotor() if focuser else None
        self.site: Pair = site
        self.zone, self.daylight, self.rtc_ahead = utc_offset, 0, 0.0
        self.aligned: bool = aligned
        self.asleep, self.mode = False, OFF
        self._set_up(wedge, rates["fastest"], speed, ramps)

    def _set_version(self, version: str | None, starsense: bool) -> None:
        """Set the version that ``V`` reports and the one whose commands are simulated. Raises UserError if invalid."""
        try:
            number = parse(version or (STARSENSE if starsense else self.facts["versions"][-1]))
            self.reported_version: Version = (number.reported[0], number.reported[1], *number.reported[2:3])
            bytes(self.reported_version)  # ``V`` reports each number as one byte
        except (ValueError, IndexError):
            known = "write it like 4.21 or starsense-1.20"
            raise UserError(f"{version!r} is not a hand-control version; {known}") from None
        self.starsense: bool = number.starsense
        self.version: Version = number.counts_as
        self.mode_by_code = modes_by_code(self.facts, self.version)
        self.goto: RestartableGoto | None = None

    def _set_up(self, wedge: bool, max_speed: float, speedup: float, ramps: bool) -> None:
        """Create the mechanics: a fork starts at the meridian, a German mount at the pole; if aligned, they track."""
        build = Build.GERMAN if self.german else Build.WEDGE if wedge else Build.ALTAZ
        north = self.site[0] >= 0
        start = GERMAN_START_AXES
        if not self.german:
            start = 180.0 if north else 0.0, 45.0 if build is Build.ALTAZ else 0.0
        self.mechanics = Mechanics(build, Observer(*self.site), self.now, start)
        self.mechanics.max_rate, self.mechanics.speedup = max_speed, speedup
        self.mechanics.acceleration = max_speed / RAMP_SECONDS if ramps else math.inf
        self.encoder_offset = [float(self.facts.get("index", start[0])) - start[0] if self.german else 0.0, 0.0]
        if self.aligned:
            self.track(ALTAZ if build is Build.ALTAZ else EQ_NORTH if north else EQ_SOUTH)
        else:
            self.encoder_offset = [-start[0], -start[1]]
            self.mechanics.correct(self.now, (-start[0], -start[1]))

    # --- used by the commands ---------------------------------------------------------------------------

    @property
    def german(self) -> bool:
        return bool(self.facts["mount"] == "german")

    def utc(self) -> float:
        """Return the hand control's own time, Unix seconds."""
        return self.now + self.mechanics.sky.clock_ahead

    def encoders(self) -> Pair:
        """Return the motor positions as the hand control counts them, degrees."""
        first, second = self.mechanics.axes(self.now)
        return wrap360(first + self.encoder_offset[0]), wrap180(second + self.encoder_offset[1])

    def has_device(self, device: int) -> bool:
        """Whether the device is on this mount's bus."""
        has = self.facts["has"]
        return device in (AZM, ALT) or (device, True) in (
            (GPS, "gps" in has),
            (RTC, "rtc" in has),
            (FOCUSER, self.focuser is not None),
        )

    def track(self, mode: int) -> None:
        """Store the tracking mode, and track in it; ``OFF`` ends tracking."""
        self.mode = mode
        if mode != OFF and not self.german:
            self.mechanics.set_build(self.now, Build.ALTAZ if mode == ALTAZ else Build.WEDGE)
        self.mechanics.track(self.now, mode != OFF, sense=-1 if mode == EQ_SOUTH else 1)

    def relocate(self, observer: Observer) -> None:
        """Use another site or clock. An aligned StarSense loses its alignment."""
        self.mechanics.relocate(self.now, observer)
        if self.starsense and self.aligned:
            self.aligned = False
            self.mechanics.stop_goto(self.now)
            self.track(OFF)

    def advance_to_now(self) -> None:
        """Advance to the present time; restart a goto and restore the hand control's tracking if they are due."""
        self.now = self.clock()
        if self.goto is not None and self.goto.cancelled_at + GOTO_RESTART_DELAY <= self.now:
            self.mechanics.goto_sky(self.goto.cancelled_at + GOTO_RESTART_DELAY, self.goto.ra, self.goto.dec)
            self.goto = None
        since = self.mechanics.suspended_since
        if since is not None and self.mode != OFF and not self.asleep:
            due = self.last_byte_at + QUIET_BEFORE_RESTORE
            if self.mechanics.build is Build.ALTAZ:
                due = min(due, since + MAX_ALTAZ_SUSPENSION)
            if due <= self.now:
                self.mechanics.resume_tracking(due)
