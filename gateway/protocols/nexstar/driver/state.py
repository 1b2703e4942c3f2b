"""What the driver knows of the mount it has found, and what it remembers between two operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

from msgspec import Struct, ValidationError, convert, to_builtins
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Fault, Refused, Unsupported
from gateway.protocols.base.driver import SLEWING, GotoUnderWay, Handler, SavedValues, Send
from gateway.protocols.base.spec import DriverSettings
from gateway.protocols.nexstar.counting import SIDEREAL, rate_tables
from gateway.protocols.nexstar.driver.hand_control import HandControl
from gateway.protocols.wireformat.rows import Version


class GotoState(GotoUnderWay):
    """``seen`` is whether the mount has said so itself."""

    seen: bool = False
    seeks: bool = False  # the motors look for their switches: only they know when it is over


class Stepping(Struct):
    """An axis that moves by small gotos: degrees a second west or north, since when, and from where (once known)."""

    speed: float
    since: float
    start: float | None = None


class Memory(Struct, omit_defaults=True):
    """What outlives the gateway."""

    home: op.Horizontal | None = None
    parked: bool = False
    model: str | None = None
    version: Version | None = None
    tracking: op.Tracking | None = None


class NexStar(HandControl):
    """A Celestron mount. ``now`` is any clock that never goes back, in seconds."""

    sync_aligns = False

    def __init__(
        self,
        now: Callable[[], float],
        settings: DriverSettings = DriverSettings(),
        handlers: Mapping[str, Handler] = {},
    ) -> None:
        super().__init__(settings.model, settings.version, handlers)
        rate_tables()  # read now: when the first arrow comes there may be no file left that can be opened
        self.now, self.settings = now, settings
        # the drive
        self.tracking: op.Tracking | None = None
        self.native_mode: op.Tracking | None = None
        self.rate = op.TrackRate(name="sidereal")
        #: The motor in right ascension tracks by the hand control's ``own`` rate, by one it was ``told``, or that is
        #: ``replaced`` while it is guided.
        self.drive = "own"
        self.aligned = False
        # motion
        self.goto: GotoState | None = None
        #: The axes that move by hand, and how fast, degrees a second.
        self.moving: dict[int, float] = {}
        self.suspended: op.Tracking | None = None
        #: Whether it was suspended before the line was lost, or in an earlier run: perhaps the mount was off since.
        self.in_doubt = False
        self.checks_left = 0
        #: It was woken, and is to go on tracking by and by.
        self.woken = False
        self.steps: dict[int, Stepping] = {}
        self.guide_rates = dict.fromkeys(AXES, settings.guide_rate or GUIDE_RATE)  # of pulses, until they are set
        #: The axes that a guide pulse turns which has to be ended by a command.
        self.pulsing: set[int] = set()
        #: What is added to the tracking rates of both axes of an alt-az mount, degrees a second: a share for each axis
        #: that was asked for; and those tracking rates.
        self.riding: dict[int, tuple[float, float]] = {}
        self.following: tuple[float, float] = (0.0, 0.0)
        #: How many seconds after one motor the other one was told, the last time; None where none was told yet.
        self.apart: float | None = None
        #: When the pulse that a motor times itself is over, axis by axis.
        self.pulse_ends: dict[int, float] = {}
        # position
        self.last: op.Equatorial | None = None
        #: Whether its declination was beyond 90 degrees when it was told last.
        self.beyond_pole = False
        self.offset: tuple[float, float] = (0.0, 0.0)
        self.home: op.Horizontal | None = None
        self.home_state = 0

    @property
    def has_sync_offset(self) -> bool:  # type: ignore[override]
        """A hand control without sync: it is carried out here."""
        return self.offset != (0.0, 0.0)

    @property
    def tracking_suspended(self) -> bool:  # type: ignore[override]
        return self.suspended is not None

    def at_rest(self) -> None:
        """Nothing moves any more, and nothing is to be ended."""
        self.goto = None
        self.moving.clear()
        self.steps.clear()
        self.not_guided()
        self.pulsing.clear()
        self.riding.clear()

    def give_up_goto(self) -> None:
        """One that led home did not get there."""
        if self.goto is not None and self.goto.then == "home":
            self.home_state = 0
        self.goto = None

    def not_guided(self) -> None:
        """Nothing takes the place of tracking any more, by a goto or a stop; the drive rate is still to be told."""
        self.drive = "told" if self.drive == "replaced" else self.drive

    def saved_state(self, moving: bool) -> SavedValues:
        """Home and park; in motion also how to talk to this hand control, and the tracking to come back to."""
        speaks = (self.model, self.version, self.suspended or self.tracking) if moving else ()
        return cast(SavedValues, to_builtins(Memory(self.home, self.parked, *speaks)))

    def restore_state(self, saved: SavedValues, moving: bool) -> None:
        """The rate of the drive is not among it: it ends with the gateway, as with a hand control's power."""
        try:
            held = convert(saved, Memory)
        except ValidationError:
            return
        self.home, self.parked = held.home, held.parked
        if moving:
            self.model, self.version = held.model or self.model, held.version or self.version
            if held.tracking is not None and self.supports("T"):
                self.suspended, self.in_doubt = held.tracking, True
                self.native_mode = None if held.tracking is op.Tracking.OFF else held.tracking

    def line_was_lost(self) -> None:
        """Tracking is put back only where the mount is aligned still."""
        self.in_doubt = self.suspended is not None

    def speed(self, rate: op.Rate) -> float:
        variable = self.variable(rate)
        return self.key_speed(self.key_for(rate)) if variable is None else variable

    def variable(self, rate: op.Rate) -> float | None:
        """Degrees a second, given to the motor as they are; None where one of the nine fixed rates is meant.

        A limit of the fastest rate is given so, too, where it is below that rate and no key turns at it.
        """
        if rate.name == "guide" and rate.degrees is None:
            asked = self.guide_rates[1] * SIDEREAL
            return None if self.exact_key(asked) is not None else asked
        if rate.key is not None or rate.degrees is None:
            return None
        if rate.name is not None and (
            rate.degrees >= self.key_speed(9) or abs(self.key_speed(self.key_for(rate)) - rate.degrees) < SAME_SPEED
        ):
            return None
        return min(rate.degrees, float(self.rates["fastest"]))

    def exact_key(self, degrees: float) -> int | None:
        """The gentle key that turns at so many degrees a second, if one does."""
        return next((key for key in GENTLE if abs(self.key_speed(key) - degrees) <= SAME_GUIDING * degrees), None)

    def can_do(self, equatorial: bool) -> op.Abilities:
        found = super().can_do(equatorial)
        home = self.home is not None or (self.settings.aux_home and self.has("home"))
        speeds = ((0.25 / 3600.0, float(self.rates["fastest"])),)
        guides = self.guide_rates[1], self.guide_rates[2]
        return replace(found, can=found.can if home else found.can - {"Home"}, speeds=speeds, guides=guides)

    def impossible(self, operation: op.Operation) -> Fault | None:
        """A guide pulse by motor sense, where the motors cannot be guided now."""
        return self.unguided() if isinstance(operation, op.PulseAxis) else None

    @property
    def times_pulses(self) -> bool:
        """Whether both motors know guide pulses, which they add to whatever they do."""
        return bool(self.motors) and min(self.motors.values()) >= PULSE_FIRMWARE

    def unguided(self) -> Fault | None:
        """Why it cannot be guided by motor sense now; None where it can.

        Older motors are given a rate that differs from equatorial tracking for as long, so a mount that does not
        track, or tracks in alt-az, cannot be guided so.
        """
        if self.goto is not None:
            return Refused(SLEWING)
        if self.times_pulses:
            return None
        if self.moves_by_gotos:
            return Unsupported("Hand controls before 1.6 have no way to the motors: this mount cannot be guided.")
        if (self.tracking or op.Tracking.OFF).equatorial:
            return None
        if not self.aligned:
            return Unsupported("The mount is not aligned and does not track: the guide pulse is dropped.")
        if self.german or (self.native_mode or op.Tracking.OFF).equatorial:
            return Unsupported("The mount does not track: the guide pulse is dropped. Tracking on, and it is guided.")
        return Unsupported("This mount cannot be guided in alt-az: its motors know no guide pulses.")

    def tube_side(self, told: str) -> str | None:
        """The letter of ``PierSide`` on a German mount, if it was told; the other one where the version swaps them."""
        if not self.german or not told:
            return None
        swapped = self.southern and self.version is not None and self.version <= LETTERS_SWAPPED
        return ("E" if told == "W" else "W") if swapped else told

    def destination(self, operation: op.Operation) -> op.GotoAxes | None:
        """Park: the configured position, else the pole or north, as low as is allowed; Home: the stored one."""
        if isinstance(operation, op.Park):
            return op.GotoAxes(*(self.settings.park or self._index))
        if isinstance(operation, op.Home) and self.home is not None:
            return op.GotoAxes(self.home.az, self.home.alt)
        return None

    def home_refused(self) -> None:
        """``:h?#`` is 0 then."""
        self.home_state = 0

    @property
    def _index(self) -> tuple[float, float]:
        """The pole of an equatorial mount (a fork on its wedge reads from north); another's north, at the horizon or
        above the lowest altitude, by so much that it may track there when it is unparked.
        """
        if self.german:
            return POLE_AXES
        if self.native_mode is not None and self.native_mode.equatorial:
            return (0.0 if self.native_mode is op.Tracking.EQ_SOUTH else 180.0), 90.0
        return 0.0, max(0.0, self.settings.lowest + ABOVE_LOWEST)

    def key_for(self, rate: op.Rate) -> int:
        """The key that comes nearest to a hand rate (never above one given in degrees a second)."""
        if rate.key is not None:
            return max(1, min(9, rate.key))
        if rate.name is not None and rate.degrees is None:
            guides = min(GENTLE, key=lambda key: abs(self.key_speed(key) - self.guide_rates[1] * SIDEREAL))
            return {"guide": guides, "center": 4, "find": 7, "max": 9}[rate.name]
        wanted = rate.degrees or 0.0
        return max([key for key in range(1, 10) if self.key_speed(key) <= wanted + 1e-9], default=1)


def rest(axis: int) -> Send:
    return Send(f"slew_{AXES[axis]}_pos", {"rate": 0})


#: What the motors of both axes are called in the names of commands.
AXES = {1: "azm", 2: "alt"}
#: Of a mount whose owner has not chosen any, as a part of sidereal: its motors' own.
GUIDE_RATE = 0.5
#: Keys that add to equatorial tracking (NexStar protocol, Slewing Commands, note).
GENTLE = (1, 2)
#: Speeds this near are one, degrees a second; of guiding, as a part of the speed.
SAME_SPEED, SAME_GUIDING = 0.01, 0.02
#: Motor firmware that knows guide pulses.
PULSE_FIRMWARE = (6, 12)
#: Up to this version the pier side is told with its letters swapped in the southern hemisphere.
LETTERS_SWAPPED = (5, 24)
#: Where a German mount's axes stand when it points at the pole: both at their index.
POLE_AXES = (90.0, 90.0)
#: How far above the lowest altitude a fork is parked, degrees.
ABOVE_LOWEST = 0.5
