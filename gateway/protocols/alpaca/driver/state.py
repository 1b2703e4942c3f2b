"""The driver's state of a telescope behind an Alpaca server: its reported abilities, and its motions.

The driver refuses, with a message, any operation that the server lacks or reports as impossible.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping
from typing import Any

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, Refused, Unsupported
from gateway.protocols.alpaca.tables import UnreadableMember
from gateway.protocols.base.driver import SLEWING_MESSAGE, Driver, Handler, SavedValues, Send, Step, Steps, Wait
from gateway.protocols.base.spec import DriverSettings
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

#: Request -> the member that reports whether the mount can carry it out.
ABILITY_MEMBERS = {
    "findhome": "canfindhome", "park": "canpark", "unpark": "canunpark", "pulseguide": "canpulseguide",
    "set_tracking": "cansettracking", "synctocoordinates": "cansync", "slewtocoordinates": "canslew",
    "slewtocoordinatesasync": "canslewasync", "slewtoaltaz": "canslewaltaz", "slewtoaltazasync": "canslewaltazasync",
    "set_guideraterightascension": "cansetguiderates", "set_guideratedeclination": "cansetguiderates",
}  # fmt: skip
#: Operation -> the reason in the message if the mount cannot carry it out.
MISSING_ABILITY_TEXTS = {
    "Goto": "it has no gotos", "GotoAxes": "it has no gotos to an azimuth and altitude", "Sync": "it cannot be synced",
    "Park": "it cannot be parked", "Unpark": "it cannot be unparked", "Home": "it has no home position",
    "SetTracking": "its tracking cannot be turned on or off", "Pulse": "it cannot be guided",
    "PulseAxis": "it cannot be guided", "Move": "it has no arrows", "MoveAxis": "it has no arrows",
    "SetGuideRate": "its guide rates cannot be set", "Focus": "it has no focuser of its own",
}  # fmt: skip
#: The sidereal rate, degrees a second.
SIDEREAL_RATE = SIDEREAL_ARCSEC_PER_S / 3600.0
#: Rate name -> speed, and the speeds of the nine rate keys of a hand control, degrees a second.
NAMED_SPEEDS = {"guide": SIDEREAL_RATE, "center": 16 * SIDEREAL_RATE, "find": 0.5, "max": math.inf}
KEY_SPEEDS = (0.5 * SIDEREAL_RATE, SIDEREAL_RATE, 4 * SIDEREAL_RATE, 16 * SIDEREAL_RATE, 0.13, 0.25, 0.5, 1.5, math.inf)
#: From this speed on, degrees a second, tracking makes no visible difference to a motion by hand.
SLOW_MOTION_LIMIT = 0.1
#: The greatest speed that is used, degrees a second: beyond it the gateway could not enforce limits.
MAX_SPEED = 8.0
#: Value of ``reversed-axes`` -> axes.
REVERSED_AXES = {"none": (), "first": (1,), "second": (2,), "both": (1, 2)}
#: The models in the order of ASCOM's numbers of alignment modes.
MODELS = ("altaz", "polar", "german")
#: How many times an important member is read until that succeeds, and the seconds between.
READ_ATTEMPTS, READ_RETRY_DELAY = 2, 0.5


class AlpacaDriver(Driver):
    """The driver of a telescope behind an Alpaca server. ``now`` is a monotonic clock, seconds."""

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
        #: Local time minus UTC, hours, as it was set last: servers have no time zone.
        self.utc_offset = 0.0
        #: Whether it tracks while nothing moves it, by the last report or order; None before that.
        self.tracks: bool | None = None
        #: Until this time of ``now``, reports of tracking may still describe the last motion, and are ignored.
        self.tracking_stale_until = -math.inf
        #: Axis moved by hand -> the rate sent for it, degrees a second, with the sign of MoveAxis.
        self.hand_rates: dict[int, float] = {}
        #: Whether the driver has turned tracking off for slow motion by hand.
        self.tracking_paused = False
        #: Axis in slow motion -> its speed on the sky in the motor's sense, degrees a second.
        self.slow_speeds: dict[int, float] = {}
        #: Axis that only follows the sky during slow motion of the other -> the rate sent for it, degrees a second.
        self.following_speeds: dict[int, float] = {}
        #: Axis that is moved by hand in guide pulses -> their direction.
        self.pulse_directions: dict[int, op.Direction] = {}
        #: Whether the last motion was by hand: the server may report Slewing until the motors stand still.
        self.moved_by_hand = False
        #: The axes whose MoveAxis counts the other way, as configured; None: observed motions decide.
        self.reversed = REVERSED_AXES.get(settings.reversed_axes or "")
        self.on_line_up()

    def on_line_up(self) -> None:
        """Forget the reports of the server: another server may listen at this address now."""
        #: Members that the server lacks, and requests that the mount cannot carry out.
        self.absent_members: set[str] = set()
        #: Members whose value the server has sent.
        self.present_members: set[str] = set()
        #: Axis -> the ranges of its speeds, degrees a second, up to MAX_SPEED; axis -> whether it can be moved by hand.
        self.ranges: dict[int, tuple[tuple[float, float], ...]] = {}
        self.is_movable: dict[int, bool] = {}
        #: Whether the server has DeviceState, a single answer with everything that is read often.
        self.lists_state = False
        #: The guide rates of the two axes as fractions of sidereal.
        self.guide_rates: tuple[float, float] = (0.5, 0.5)
        #: Whether it is a German mount that does not report the side of the pier.
        self.hides_pier_side = False
        #: The side of the pier by the hour angle of the last goto's target; empty if unknown.
        self.goto_side = ""
        #: (axis, side of the pier) -> -1 where a motion has shown that MoveAxis counts the other way.
        self.signs: dict[tuple[int, str], int] = {}
        #: (axis, side of the pier) where a motion has shown which way MoveAxis counts.
        self.verified_senses: set[tuple[int, str]] = set()
        #: Axis whose motion is being compared -> expected sense on the sky, side of the pier, first position.
        self.sense_checks: dict[int, tuple[int, str, tuple[float, float] | None]] = {}
        #: Whether the server declares an equinox; whether that was compared with its altitude and azimuth.
        self.declares_equinox = self.equinox_compared = False
        #: Whether the altitudes that the server reports may include refraction.
        self.refracts = False

    @property
    def model_row(self) -> Model:
        """The row of ``models.toml`` for its kind of mount; an unknown kind counts as German."""
        return self.protocol.models[self.model or "german"]

    @property
    def german(self) -> bool | None:  # type: ignore[override]
        return None if self.model is None else bool(self.model_row["mount"] == "german")

    @property
    def equatorial(self) -> bool:
        return self.model != "altaz"

    @property
    def times_pulses(self) -> bool:  # type: ignore[override]
        return self.supports("pulseguide")

    @property
    def position_reads(self) -> int:  # type: ignore[override]
        return 1 if self.lists_state else 2

    def moveaxis_sign(self, axis: int, pier_side: str) -> int:
        """Return -1 if MoveAxis of this axis counts against the sense of the motor, else 1."""
        return self.signs.get((axis, pier_side), 1) if self.reversed is None else -1 if axis in self.reversed else 1

    def may_be_moving(self, axis: int) -> bool:
        """Whether this axis may be moving by hand, also for another program, so that a stop must include it."""
        return axis in self.hand_rates or self.is_movable.get(axis, True)

    def supports(self, command: str) -> bool:
        """Whether the mount can carry out a request, by what the server has reported."""
        if command == "moveaxis" and self.ranges:
            return any(self.ranges.values())
        return command not in self.absent_members and super().supports(command)

    def perform(self, operation: op.Operation[Any]) -> Generator[Step, Any, Any]:
        """Carry out an operation. Raises Unsupported, with a text that says what the mount lacks, and other Faults."""
        if (missing := self._missing_ability(operation)) is not None:
            raise missing
        return (yield from super().perform(operation))

    def give_up_goto(self) -> None:
        """Forget the goto under way; the side of the pier is then unknown."""
        self.goto_side = "" if self.goto is not None else self.goto_side
        self.goto = None

    def saved_state(self, moving: bool) -> SavedValues:
        return {"suspended": True} if self.tracking_paused else {}

    def restore_state(self, saved_values: SavedValues, moving: bool) -> None:
        if moving and saved_values.get("suspended") is True:  # the stop that is owed turns tracking on again
            self.tracking_paused = self.tracks = True

    def certain_fault(self, operation: op.Operation) -> Fault | None:
        if self.goto is not None and isinstance(operation, op.Pulse | op.PulseAxis):
            return Refused(SLEWING_MESSAGE)
        return self._missing_ability(operation)

    def _missing_ability(self, operation: op.Operation) -> Fault | None:
        missing = MISSING_ABILITY_TEXTS.get(type(operation).__name__)
        if missing is None or self.implementation(type(operation)) is not None:
            return None
        return Unsupported(f"The server of this mount reports that {missing}.")

    @property
    def reports_pier_side(self) -> bool:  # type: ignore[override]
        return not self.hides_pier_side

    def tube_side(self, reported_side: str) -> str | None:
        return (reported_side or None) if self.german else None

    def max_speed(self, axis: int | None = None) -> float:
        several = [high for of_axis, ranges in self.ranges.items() if axis in (None, of_axis) for _, high in ranges]
        return min(MAX_SPEED, max(several, default=MAX_SPEED))

    def speed(self, rate: op.Rate) -> float:
        return (
            self.guide_rates[0] * SIDEREAL_RATE
            if self.moves_by_pulses(rate)
            else max(self.fit(axis, rate) for axis in (1, 2))
        )

    def moves_by_pulses(self, rate: op.Rate) -> bool:
        """Whether motion by hand at this rate consists of guide pulses: MoveAxis cannot add it to tracking."""
        wanted = self.requested_speed(rate)
        if wanted >= SLOW_MOTION_LIMIT or not (self.equatorial and self.times_pulses and self.tracks):
            return False
        sums = (SIDEREAL_RATE + wanted, SIDEREAL_RATE - wanted)
        return any(abs(self.nearest_rate(1, total) - total) > wanted / 2.0 for total in sums)

    def requested_speed(self, rate: op.Rate) -> float:
        """Return the speed that a rate of motion by hand stands for, degrees a second."""
        wanted = KEY_SPEEDS[(rate.key or 1) - 1] if rate.name is None else NAMED_SPEEDS[rate.name]
        if rate.degrees is not None:
            wanted = min(wanted, rate.degrees) if rate.name == "max" else rate.degrees
        return abs(wanted)

    def fit(self, axis: int, rate: op.Rate) -> float:
        """Return the speed of this axis that is nearest to a rate of motion by hand, degrees a second."""
        wanted = max(1e-6, min(self.requested_speed(rate), self.max_speed(axis)))
        near = [max(low, min(high, wanted)) for low, high in self.ranges.get(axis, ())]
        return min(near, key=lambda speed: abs(math.log(max(speed, 1e-6) / wanted)), default=wanted)

    def nearest_rate(self, axis: int, rate: float) -> float:
        """Return the possible rate of this axis nearest to ``rate``, with the same sign, or 0; degrees a second."""
        low = [max(low, min(high, abs(rate))) for low, high in self.ranges.get(axis, ())]
        return math.copysign(min((*low, 0.0), key=lambda speed: abs(speed - abs(rate))), rate)

    def abilities(self, equatorial: bool) -> op.Abilities:
        able = super().abilities(equatorial)
        return op.Abilities(able.can, self.ranges.get(1, ()), self.guide_rates, self.german)


def read_member(mount: AlpacaDriver, member: str, default: Any = None, **values: object) -> Steps:
    """Return the value of a member; ``default`` if the server lacks it or fails to read it. The driver does not request
    a member again that the server has never sent and reports as missing.
    """
    if member in mount.absent_members:
        return default
    try:
        answer = yield Send(member, values)
    except NoAnswer:
        raise
    except Fault as fault:
        missing = isinstance(fault, Unsupported) and not isinstance(fault, UnreadableMember)
        if missing and not values and member not in mount.present_members:
            mount.absent_members.add(member)
        return default
    mount.present_members.add(member)
    return next(iter(answer.values()), default)


def read_member_again(mount: AlpacaDriver, member: str, default: Any = None, **values: object) -> Steps:
    """Return the value of a member like ``read_member``, but read it again after a failure, which may be temporary."""
    for left in reversed(range(READ_ATTEMPTS)):
        value = yield from read_member(mount, member, **values)
        if value is not None:
            return value
        if left and member not in mount.absent_members:
            yield Wait(READ_RETRY_DELAY)
    return default


def read_state(mount: AlpacaDriver, reader: Callable[..., Steps] = read_member) -> Steps:
    """Return name -> value for the values in the answer to DeviceState; empty if the server lacks that, or fails."""
    listed = yield from reader(mount, "devicestate", [])
    if not isinstance(listed, list):
        return {}
    return {str(entry.get("Name")): entry.get("Value") for entry in listed if isinstance(entry, dict)}
