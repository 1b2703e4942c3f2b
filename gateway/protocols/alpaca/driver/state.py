"""What the driver knows of a telescope behind an Alpaca server: what it can do, as reported, and its motions.

Nothing is assumed: the driver refuses, with a message, what the server lacks or reports as impossible.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from typing import Any

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, Refused, Unsupported
from gateway.protocols.alpaca.tables import Untold
from gateway.protocols.base.driver import SLEWING, Driver, Handler, SavedValues, Send, Step, Steps, Wait
from gateway.protocols.base.spec import DriverSettings
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: Request -> the member that tells whether the mount can carry it out.
TOLD_BY = {
    "findhome": "canfindhome", "park": "canpark", "unpark": "canunpark", "pulseguide": "canpulseguide",
    "set_tracking": "cansettracking", "synctocoordinates": "cansync", "slewtocoordinates": "canslew",
    "slewtocoordinatesasync": "canslewasync", "slewtoaltaz": "canslewaltaz", "slewtoaltazasync": "canslewaltazasync",
    "set_guideraterightascension": "cansetguiderates", "set_guideratedeclination": "cansetguiderates",
}  # fmt: skip
#: Operation -> what is missing on a mount that cannot carry it out.
MISSING = {
    "Goto": "it has no gotos", "GotoAxes": "it has no gotos to an azimuth and altitude", "Sync": "it cannot be synced",
    "Park": "it cannot be parked", "Unpark": "it cannot be unparked", "Home": "it has no home position",
    "SetTracking": "its tracking cannot be turned on or off", "Pulse": "it cannot be guided",
    "PulseAxis": "it cannot be guided", "Move": "it has no arrows", "MoveAxis": "it has no arrows",
    "SetGuideRate": "its guide rates cannot be set", "Focus": "it has no focuser of its own",
}  # fmt: skip
#: The sidereal rate, degrees a second.
SIDEREAL = SIDEREAL_ARCSECONDS / 3600.0
#: Speeds of the named rates and of the hand control's keys, degrees a second, where a mount has them.
NAMED = {"guide": SIDEREAL, "center": 16 * SIDEREAL, "find": 0.5, "max": math.inf}
KEYS = (0.5 * SIDEREAL, SIDEREAL, 4 * SIDEREAL, 16 * SIDEREAL, 0.13, 0.25, 0.5, 1.5, math.inf)
#: At this speed (degrees a second) and above, tracking makes no visible difference to the motion.
SLOW = 0.1
#: The greatest speed that is used, degrees a second: beyond it the gateway could not enforce limits.
FASTEST = 8.0
#: Words of ``reversed-axes`` -> axes.
REVERSED = {"none": (), "first": (1,), "second": (2,), "both": (1, 2)}
#: ASCOM's numbers of alignment modes -> models.
MODELS = ("altaz", "polar", "german")
#: How often a question is asked on whose answer much depends, and the seconds between.
TIMES, AGAIN = 2, 0.5


class AlpacaDriver(Driver):
    """A telescope of an Alpaca server. ``now`` is a monotonic clock, seconds."""

    protocol = load("alpaca")
    default_equinox = "auto"

    def __init__(
        self,
        now: Callable[[], float],
        settings: DriverSettings = DriverSettings(),
        handlers: Mapping[str, Handler] = {},
    ) -> None:
        super().__init__(handlers)
        self.now, self.settings = now, settings
        self.model: str | None = settings.model
        self.home_state = 0
        #: Local time minus UTC, hours, as it was set last: no server has a zone.
        self.zone = 0.0
        #: Whether it tracks when nothing moves it, by the last report or order; None before. A report may be that of a
        #: motion until its end was observed, or at the latest until this time.
        self.tracks: bool | None = None
        self.doubted_until = -math.inf
        #: Axis -> the rate at which it moves by hand, degrees a second, signed as it was sent.
        self.moving: dict[int, float] = {}
        #: Whether tracking is off for slow motion; the axes in slow motion and their speeds on the sky, as the motor
        #: counts, those that only follow the sky meanwhile, and at what speeds all follow it; degrees a second.
        self.suspended = False
        self.slow: dict[int, float] = {}
        self.following: dict[int, float] = {}
        #: The axes that are moved by guide pulses, and their directions.
        self.pulsed: dict[int, op.Direction] = {}
        #: Whether the last motion was by hand: the server may report it until the motors stand still.
        self.by_hand = False
        #: The axes whose MoveAxis counts the other way, as the user says; None: as motions show.
        self.reversed = REVERSED.get(settings.reversed_axes or "")
        self.line_was_lost()

    def line_was_lost(self) -> None:
        """Forget the reports of the server: another server may listen at this address now."""
        #: Members that the server does not have, and requests that the mount cannot carry out; members that it has.
        self.absent: set[str] = set()
        self.present: set[str] = set()
        #: Axis -> the ranges of its speeds, degrees a second, up to FASTEST; whether it may be moved by hand at all.
        self.ranges: dict[int, tuple[tuple[float, float], ...]] = {}
        self.movable: dict[int, bool] = {}
        #: Whether a single answer lists everything that is read often.
        self.lists_state = False
        self.rates: tuple[float, float] = (0.5, 0.5)
        #: Whether it is a German mount that does not tell the side of the pier; the side of the last goto's goal by its
        #: hour angle, empty if that is not known either.
        self.side_untold, self.goto_side = False, ""
        #: (axis, side of the pier) -> -1 where a motion has shown that MoveAxis counts the other way; where one has
        #: shown the sense at all; and axis -> the sense on the sky, the side, and the first position of the motion that
        #: is compared now.
        self.senses: dict[tuple[int, str], int] = {}
        self.proven: set[tuple[int, str]] = set()
        self.expected: dict[int, tuple[int, str, tuple[float, float] | None]] = {}
        #: Whether the server declares an equinox, and whether that was compared with what it sends.
        self.declared = self.compared = False
        #: Whether its altitudes may be raised by refraction.
        self.refracts = False

    @property
    def facts(self) -> Model:
        """The row of its kind of mount; a mount of unknown kind counts as a German mount."""
        return self.protocol.models[self.model or "german"]

    @property
    def german(self) -> bool | None:  # type: ignore[override]
        return None if self.model is None else bool(self.facts["mount"] == "german")

    @property
    def equatorial(self) -> bool:
        return self.model != "altaz"

    @property
    def times_pulses(self) -> bool:  # type: ignore[override]
        return self.supports("pulseguide")

    @property
    def position_reads(self) -> int:  # type: ignore[override]
        return 1 if self.lists_state else 2

    def sign(self, axis: int, side: str) -> int:
        """Return -1 if MoveAxis counts against the sense of the motor, else 1."""
        return self.senses.get((axis, side), 1) if self.reversed is None else -1 if axis in self.reversed else 1

    def may_move(self, axis: int) -> bool:
        """Whether this axis is moved by hand, or may be by another program: a stop includes it."""
        return axis in self.moving or self.movable.get(axis, True)

    def supports(self, name: str) -> bool:
        """Whether the mount can carry out a request, as far as the server has reported."""
        if name == "moveaxis" and self.ranges:
            return any(self.ranges.values())
        return name not in self.absent and super().supports(name)

    def perform(self, operation: op.Operation[Any]) -> Generator[Step, Any, Any]:
        """Carry out an operation. Raises Unsupported with what the mount lacks, and other Faults."""
        if (missing := self._missing(operation)) is not None:
            raise missing
        return (yield from super().perform(operation))

    def give_up_goto(self) -> None:
        """Forget the goto under way: nobody knows on which side of the pier it has ended."""
        self.goto_side = "" if self.goto is not None else self.goto_side
        self.goto = None

    def saved_state(self, moving: bool) -> SavedValues:
        return {"suspended": True} if self.suspended else {}

    def restore_state(self, saved_values: SavedValues, moving: bool) -> None:
        if moving and saved_values.get("suspended") is True:  # the stop that is owed turns tracking on again
            self.suspended = self.tracks = True

    def impossible(self, operation: op.Operation) -> Fault | None:
        if self.goto is not None and isinstance(operation, op.Pulse | op.PulseAxis):
            return Refused(SLEWING)
        return self._missing(operation)

    def _missing(self, operation: op.Operation) -> Fault | None:
        missing = MISSING.get(type(operation).__name__)
        if missing is None or self.implementation(type(operation)) is not None:
            return None
        return Unsupported(f"The server of this mount reports that {missing}.")

    @property
    def tells_side(self) -> bool:  # type: ignore[override]
        return not self.side_untold

    def tube_side(self, reported: str) -> str | None:
        return (reported or None) if self.german else None

    def fastest(self, axis: int | None = None) -> float:
        several = [high for of_axis, ranges in self.ranges.items() if axis in (None, of_axis) for _, high in ranges]
        return min(FASTEST, max(several, default=FASTEST))

    def speed(self, rate: op.Rate) -> float:
        return self.rates[0] * SIDEREAL if self.by_pulses(rate) else max(self.fit(axis, rate) for axis in (1, 2))

    def by_pulses(self, rate: op.Rate) -> bool:
        """Whether an arrow at this rate is a series of guide pulses: the first axis, tracking, has no speed near it."""
        wanted = self.wanted(rate)
        if wanted >= SLOW or not (self.equatorial and self.times_pulses and self.tracks):
            return False
        sums = (SIDEREAL + wanted, SIDEREAL - wanted)
        return any(abs(self.nearest(1, total) - total) > wanted / 2.0 for total in sums)

    def wanted(self, rate: op.Rate) -> float:
        """Return the speed that a hand rate means, degrees a second."""
        wanted = KEYS[(rate.key or 1) - 1] if rate.name is None else NAMED[rate.name]
        if rate.degrees is not None:
            wanted = min(wanted, rate.degrees) if rate.name == "max" else rate.degrees
        return abs(wanted)

    def fit(self, axis: int, rate: op.Rate) -> float:
        """Return the speed nearest to a hand rate that this axis has, degrees a second."""
        wanted = max(1e-6, min(self.wanted(rate), self.fastest(axis)))
        near = [max(low, min(high, wanted)) for low, high in self.ranges.get(axis, ())]
        return min(near, key=lambda speed: abs(math.log(max(speed, 1e-6) / wanted)), default=wanted)

    def nearest(self, axis: int, rate: float) -> float:
        """Return the signed rate of the axis that is nearest to a rate, or 0; degrees a second."""
        low = [max(low, min(high, abs(rate))) for low, high in self.ranges.get(axis, ())]
        return math.copysign(min((*low, 0.0), key=lambda speed: abs(speed - abs(rate))), rate)

    def can_do(self, equatorial: bool) -> op.Abilities:
        able = super().can_do(equatorial)
        return op.Abilities(able.can, self.ranges.get(1, ()), self.rates, self.german)


def read_member(mount: AlpacaDriver, member: str, default: Any = None, **values: object) -> Steps:
    """Return the value of a member; ``default`` if the server does not have the member, or fails to read it.

    If the server reports that it lacks the member, and has never sent it, it is not requested again.
    """
    if member in mount.absent:
        return default
    try:
        answer = yield Send(member, values)
    except NoAnswer:
        raise
    except Fault as fault:
        missing = isinstance(fault, Unsupported) and not isinstance(fault, Untold)
        if missing and not values and member not in mount.present:
            mount.absent.add(member)
        return default
    mount.present.add(member)
    return next(iter(answer.values()), default)


def read_member_again(mount: AlpacaDriver, member: str, default: Any = None, **values: object) -> Steps:
    """Return the same as ``read_member``, but ask again after a failure: a server may fail for a moment."""
    for left in reversed(range(TIMES)):
        value = yield from read_member(mount, member, **values)
        if value is not None:
            return value
        if left and member not in mount.absent:
            yield Wait(AGAIN)
    return default


def device_state(mount: AlpacaDriver, ask: Callable[..., Steps] = read_member) -> Steps:
    """Return all values that the server reports in one answer, by name; empty if it has no such request, or fails."""
    listed = yield from ask(mount, "devicestate", [])
    if not isinstance(listed, list):
        return {}
    return {str(entry.get("Name")): entry.get("Value") for entry in listed if isinstance(entry, dict)}
