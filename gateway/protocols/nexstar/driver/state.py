"""The driver's state: the identified hand control, the motions under way, and what survives a restart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

from msgspec import Struct, ValidationError, convert, to_builtins
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Fault, Refused, Silence, Unsupported
from gateway.protocols.base.driver import SLEWING_MESSAGE, Driver, GotoUnderWay, Handler, SavedValues, Send, Steps
from gateway.protocols.base.spec import DriverSettings
from gateway.protocols.nexstar.counting import SIDEREAL, key_speed, rate_tables
from gateway.protocols.nexstar.versions import NEXSTAR_VARIANT, STARSENSE_VARIANT, letters_swapped, mode_code, parse
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model, Version

#: The version that is presented until the hand control has reported its own.
DEFAULT_VERSION: Version = (4, 21)
#: Timeout of ``v``, seconds: not every version answers it.
VARIANT_TIMEOUT = 1.5
#: The first version that uses coordinates of date.
JNOW_FROM = (4, 14)
UNKNOWN_MODEL: Model = {"mount": "fork", "rates": "se", "has": [], "motors": "0.0", "versions": []}


class NexStarGotoState(GotoUnderWay):
    """A goto under way. ``seeks_switches``: the motors seek their home switches; only they report the end."""

    seeks_switches: bool = False


class SmallGotoMotion(Struct):
    """An axis that moves by small gotos: speed, degrees a second (west or north positive), start time and position."""

    speed: float
    started_at: float
    start_position: float | None = None


class Memory(Struct, omit_defaults=True):
    """The saved state. ``native``: tracking mode; ``code``: its byte in ``T``; ``offset``: that of an emulated sync."""

    home: op.Horizontal | None = None
    home_state: int = 0
    parked: bool = False
    native: op.Tracking | None = None
    code: int | None = None
    offset: tuple[float, float] | None = None
    rate: op.TrackRate | None = None
    guide_rates: dict[int, float] = {}
    model: str | None = None
    version: Version | None = None
    tracking: op.Tracking | None = None


class NexStar(Driver):
    """The driver's state of a Celestron mount. ``now`` is a monotonic clock in seconds.

    Model and version are as the user named them, or as the hand control has reported them.
    """

    protocol = load("nexstar")
    sync_aligns = False
    goto_unparks = True

    def __init__(
        self,
        now: Callable[[], float],
        settings: DriverSettings = DriverSettings(),
        handlers: Mapping[str, Handler] = {},
    ) -> None:
        super().__init__(handlers)
        rate_tables()  # read now: later the process may have run out of file descriptors
        self.now, self.settings = now, settings
        # the hand control
        named = parse(settings.version) if settings.version else None
        self.named_model = self.model = settings.model
        self.version: Version | None = named.counts_as if named else None
        self.version_text = "?"
        #: The replies to ``V`` and ``m``.
        self.reported_version: Version | None = None
        self.model_number: int | None = None
        #: Commands that it has not answered.
        self.unanswered: set[str] = set()
        self.starsense = named is not None and named.starsense
        #: The protocol dialect of its maker, as the reply to ``V`` shows it: "synscan", or None for a Celestron.
        self.dialect: str | None = self.model_facts.get("dialect")
        self.firmware: dict[int, Version] = {}  # device number of a motor -> its firmware
        self.has_focuser = False
        self.found_parts: set[str] = set()  # of ``DEVICE_BY_PART``, if the hand control does not report its model
        # the drive
        self.tracking: op.Tracking | None = None  # the mode that was reported or sent last; None before the first
        self.native_mode: op.Tracking | None = None  # the last of these modes that was not off
        #: The byte of the last mode that was not off, as ``t`` returned it or a program of this protocol sent it.
        self.mode_code: int | None = None
        self.rate = op.TrackRate(name="sidereal")  # the drive rate that was requested last
        #: How the right-ascension motor tracks: at the ``own`` rate of the hand control, at a ``special`` rate sent to
        #: it, or its tracking is ``replaced`` by a variable rate while it is guided.
        self.drive = "own"
        self.aligned = False
        # motion
        self.goto: NexStarGotoState | None = None
        #: The axes in hand motion and their speeds, degrees a second.
        self.moving: dict[int, float] = {}
        #: The tracking mode to resume after motion, OFF if it was off already; None if tracking is not suspended.
        self.suspended_mode: op.Tracking | None = None
        #: Resume tracking only if the mount is aligned: it may have been switched off since tracking was suspended.
        self.resume_needs_alignment = False
        self.mode_checks_left = 0  # how many scheduled checks of the tracking mode (``t``) are still valid
        #: The mount was woken; tracking is to be turned on shortly.
        self.was_woken = False
        self.small_goto_motions: dict[int, SmallGotoMotion] = {}
        self.guide_rates = dict.fromkeys(MOTORS, settings.guide_rate or DEFAULT_GUIDE_RATE)  # of guide pulses
        #: The axes with a guide pulse that a command has to end.
        self.pulsing: set[int] = set()
        #: Slow motion on top of the tracking of an alt-az mount: for each ordered axis the rates that it adds to both
        #: motors; and the tracking rates of both motors. Degrees a second.
        self.added_rates: dict[int, tuple[float, float]] = {}
        self.tracking_rates: tuple[float, float] = (0.0, 0.0)
        #: Seconds between the commands that gave both motors their last rates; None before the first.
        self.motor_delay: float | None = None
        #: When tracking was last turned off, loop time.
        self.suspended_at = 0.0
        #: By axis, when the last pulse that the motor times itself ends.
        self.pulse_ends: dict[int, float] = {}
        # position
        self.sync_offset = (0.0, 0.0)
        self.home_axes: op.Horizontal | None = None  # the axis readings at the stored home position
        self.home_state = 0  # as ``HomeState`` counts: 0 not at home, 1 at home, 2 on the way

    @property
    def tracking_suspended(self) -> bool:  # type: ignore[override]
        return self.suspended_mode is not None

    def record_at_rest(self) -> None:
        """Record that nothing moves and nothing has to be ended."""
        self.goto = None
        self.moving.clear()
        self.small_goto_motions.clear()
        self.record_guiding_ended()
        self.pulsing.clear()
        self.added_rates.clear()

    def give_up_goto(self) -> None:
        """Forget the goto under way, which ended early. If its goal was home, the mount now counts as not at home."""
        if self.goto is not None and self.goto.purpose == "home":
            self.home_state = 0
        self.goto = None

    def record_guiding_ended(self) -> None:
        """Record that a goto or a stop has ended guiding that replaced tracking; the drive rate is not restored yet."""
        self.drive = "special" if self.drive == "replaced" else self.drive

    def saved_state(self, moving: bool) -> SavedValues:
        """Return the values to save: home, park, unreadable settings, and the mode while it does not track; in motion
        also model, version and the tracking mode to resume.
        """
        rests = self.tracking is op.Tracking.OFF and self.suspended_mode is None
        changed = self.guide_rates != dict.fromkeys(MOTORS, self.settings.guide_rate or DEFAULT_GUIDE_RATE)
        memory = Memory(
            self.home_axes,
            int(self.home_state == 1),
            self.parked,
            self.native_mode if rests else None,
            self.mode_code if (rests or moving) and not self._mode_code_is_usual else None,
            self.sync_offset if any(self.sync_offset) else None,
            None if self.rate.name == "sidereal" else self.rate,
            self.guide_rates if changed else {},
            *((self.model, self.version, self.suspended_mode or self.tracking) if moving else ()),
        )
        return cast(SavedValues, to_builtins(memory, str_keys=True))

    def restore_state(self, saved_values: SavedValues, moving: bool) -> None:
        """Restore the saved state, unless it is invalid; ``SameMountCheck`` checks whether the mount is still in it."""
        try:
            held = convert(saved_values, Memory, str_keys=True)
        except ValidationError:
            return
        self.home_axes, self.parked, self.home_state = held.home, held.parked, held.home_state
        self.native_mode, self.mode_code, self.sync_offset = held.native, held.code, held.offset or (0.0, 0.0)
        self.guide_rates |= held.guide_rates
        if held.rate is not None:
            self.rate, self.drive = held.rate, "special"
        if moving:
            self.drive = "special"  # a motion that replaced tracking may have been cut short
            self.model, self.version = held.model or self.model, held.version or self.version
            if held.tracking is not None and self.supports("T"):
                self.suspended_mode, self.resume_needs_alignment = held.tracking, True
                self.native_mode = None if held.tracking is op.Tracking.OFF else held.tracking

    @property
    def stale_note(self) -> str:
        return "" if self.rate.name == "sidereal" else "its drive rate is the sidereal one again"

    @property
    def _mode_code_is_usual(self) -> bool:
        """Whether the byte of its tracking mode is the usual one for that mode."""
        return self.native_mode is None or self.mode_code == mode_code(self.native_mode, self.model_facts, self.version)

    def record_alignment_lost(self) -> None:
        """Reset the sync offset and the drive rate, because they belong to an alignment that was lost."""
        self.sync_offset, self.rate, self.drive = (0.0, 0.0), op.TrackRate(name="sidereal"), "own"

    def renew_settings(self) -> Steps:
        special = self.rate.name != "sidereal"
        self.record_alignment_lost()
        if special and self.aligned:
            yield from self.perform(self.rate)

    def on_line_up(self) -> None:
        """Note that suspended tracking may be resumed, after the line is back, only if the mount is still aligned."""
        self.resume_needs_alignment = self.suspended_mode is not None

    @property
    def angle_steps(self) -> tuple[float, float]:  # type: ignore[override]
        return (360.0 / 2 ** (24 if self.supports("e") else 16),) * 2

    def speed(self, rate: op.Rate) -> float:
        variable = self.variable_rate(rate)
        return self.key_speed(self.key_for(rate)) if variable is None else variable

    def variable_rate(self, rate: op.Rate) -> float | None:
        """Return the speed to send as a variable rate, degrees a second; None if one of the nine keys is to be used.

        A rate in degrees below key 9 is variable; a client's fastest rate only if no key has that speed.
        """
        if rate.name == "guide" and rate.degrees is None:
            asked = self.guide_rates[1] * SIDEREAL
            return None if self.exact_key(asked) is not None else asked
        if rate.key is not None or rate.degrees is None:
            return None
        key = self.key_speed(self.key_for(rate))
        if rate.degrees >= self.key_speed(9) or (rate.name is not None and abs(key - rate.degrees) < SPEED_TOLERANCE):
            return None
        return min(rate.degrees, float(self.rate_table["fastest"]))

    def exact_key(self, speed: float) -> int | None:
        """Return the key that turns at this speed (degrees a second) on top of tracking, or None."""
        return next((key for key in GENTLE_KEYS if abs(self.key_speed(key) - speed) <= GUIDING_TOLERANCE * speed), None)

    def abilities(self, equatorial: bool) -> op.Abilities:
        general = super().abilities(equatorial)
        home = self.home_axes is not None or (self.settings.aux_home and self.has_part("home"))
        speeds = ((0.25 / 3600.0, float(self.rate_table["fastest"])),)
        guides = self.guide_rates[1], self.guide_rates[2]
        return replace(general, can=general.can if home else general.can - {"Home"}, speeds=speeds, guides=guides)

    def certain_fault(self, operation: op.Operation) -> Fault | None:
        """Return why an operation is known to fail: a guide pulse if the motors cannot be guided now. Else None."""
        return self.guiding_refusal() if isinstance(operation, op.PulseAxis) else None

    @property
    def times_pulses(self) -> bool:  # type: ignore[override]
        """Whether both motors time guide pulses themselves, in addition to any other motion."""
        return bool(self.firmware) and min(self.firmware.values()) >= PULSE_FIRMWARE and self.supports("pulse")

    @property
    def mounting_unknown(self) -> bool:
        """Whether it may be set up in alt-az or equatorially, and its tracking has not shown yet which it is."""
        return self.native_mode is None and self.model_number in self.model_facts.get("either", ())

    def check_mounting_known(self) -> None:
        """Raise Refused if it is unknown whether the mount is set up in alt-az or equatorially."""
        if self.mounting_unknown:
            raise Refused(_MOUNTING_UNKNOWN_TEXT)

    def guiding_refusal(self) -> Fault | None:
        """Return why single motors cannot be guided now; None if they can.

        Older motors get a rate that differs from equatorial tracking for the length of the pulse. That does not work
        on a mount that does not track or tracks in alt-az.
        """
        if self.goto is not None:
            return Refused(SLEWING_MESSAGE)
        if self.times_pulses:
            return None
        if self.moves_by_gotos:
            return Unsupported("Hand controls before 1.6 have no motor commands: this mount cannot be guided.")
        if (self.tracking or op.Tracking.OFF).equatorial:
            return None
        if not self.aligned:
            return Unsupported("The mount is not aligned and does not track: the guide pulse is dropped.")
        if self.german or (self.native_mode or op.Tracking.OFF).equatorial:
            return Unsupported("The mount does not track: the guide pulse is dropped. Turn tracking on to guide it.")
        return Unsupported("This mount cannot be guided in alt-az: its motors have no guide pulses.")

    def tube_side(self, reported_side: str) -> str | None:
        """Return the true side ("E" or "W") for the letter the mount reported; None on a fork or without a letter."""
        if not self.german or not reported_side:
            return None
        northern = letters_swapped(self.model_facts, self.version) or not self.supports("p")  # then it is the axis' own
        swapped = self.southern and northern
        return ("E" if reported_side == "W" else "W") if swapped else reported_side

    def destination(self, operation: op.Operation) -> op.GotoAxes | None:
        """Return the axis readings to which Park (by default the pole or north) or Home leads; None if unknown."""
        if isinstance(operation, op.Park):
            return op.GotoAxes(*(self.settings.park or self._default_park))
        if isinstance(operation, op.Home) and self.home_axes is not None:
            return op.GotoAxes(self.home_axes.az, self.home_axes.alt)
        return None

    def on_home_refusal(self) -> None:
        """Record that homing was refused: ``:h?#`` then returns 0."""
        self.home_state = 0

    @property
    def _default_park(self) -> tuple[float, float]:
        """The default park position as axis readings: on an equatorial mount the pole; on an alt-az mount north, at the
        horizon or just above the lowest altitude, so that the mount may track when it is unparked.
        """
        if self.german:
            return POLE_AXES
        if self.native_mode is not None and self.native_mode.equatorial:
            return (0.0 if self.native_mode is op.Tracking.EQ_SOUTH else 180.0), 90.0
        return 0.0, max(0.0, self.settings.lowest + PARK_MARGIN)

    def key_for(self, rate: op.Rate) -> int:
        """Return the key nearest to a hand rate; for degrees a second the fastest that is not faster, at least 1."""
        if rate.key is not None:
            return max(1, min(9, rate.key))
        if rate.name is not None and rate.degrees is None:
            if rate.name == "guide":
                return min(GENTLE_KEYS, key=lambda key: abs(self.key_speed(key) - self.guide_rates[1] * SIDEREAL))
            return {"center": 4, "find": 7, "max": 9}[rate.name]
        wanted = rate.degrees or 0.0
        return max([key for key in range(1, 10) if self.key_speed(key) <= wanted + 1e-9], default=1)

    # --- what follows from the model and version of the hand control --------------------------------------------------

    def presented_model(self) -> Model:
        """Return the row of its model with the reported values; ``counts_as`` is the version whose commands it has."""
        shown = self.reported_version or DEFAULT_VERSION
        return {
            **self.model_facts,
            "id": self.model_facts.get("id", self.model_number or 0),
            "name": self.model or "unknown",
            "version": shown,
            "counts_as": self.version or shown,
            "own": True,
            "lacking": self.protocol.lacking_commands(self.model),
            "variant": STARSENSE_VARIANT if self.starsense else NEXSTAR_VARIANT,
        }

    def reported_model(self, identity: op.Identity) -> str | None:
        if self.model_number is None:
            return None
        rows = self.protocol.models
        if self.named_model in rows and self._row_has_number(rows[self.named_model], self.model_number):
            return self.named_model
        return self.model_by_number(self.model_number) or f"model {self.model_number}"

    def model_by_number(self, number: int) -> str | None:
        """Return the model with this number in the reply to ``m``, of the maker of this hand control; or None."""
        return next((name for name, row in self.protocol.models.items() if self._row_has_number(row, number)), None)

    def _row_has_number(self, row: Model, number: int) -> bool:
        first, last = row.get("ids", (row["id"], row["id"]))
        return row.get("dialect") == self.dialect and first <= number <= last

    def native_reply(self, operation: op.NativeRequest) -> Steps:
        """Pass a client's command on and return the raw reply. Which versions answer ``v`` is not documented.

        Raises Unsupported if the hand control lacks the command or has not answered it.
        """
        if not self.supports(operation.command) or operation.command in self.unanswered:
            raise Unsupported
        patience = VARIANT_TIMEOUT if operation.command == "v" else None
        try:
            return (yield Send(operation.command, dict(operation.fields), patience, include_raw=True))["raw"]
        except Silence:
            self.unanswered.add(operation.command)
            raise Unsupported from None

    def probe(self) -> Steps:
        """Send an echo request (``K``), which only a hand control answers: a Meade has no such command."""
        yield Send("K", {"echo": 0x78})

    @property
    def model_facts(self) -> Model:
        """The row of ``models.toml``; an unknown mount counts as an alt-az fork without extras."""
        return self.protocol.models.get(self.model or "", UNKNOWN_MODEL)

    @property
    def site_unaligns(self) -> bool:  # type: ignore[override]
        """Whether setting site or time destroys its alignment, as on a StarSense."""
        return self.starsense

    @property
    def emulates_sync(self) -> bool:  # type: ignore[override]
        """Whether the sync command is missing (it came with 4.10): the driver then applies an offset."""
        return not self.supports("s")

    @property
    def moves_by_gotos(self) -> bool:  # type: ignore[override]
        """Whether hand motion consists of small gotos: before 1.6 there is no pass-through to the motors."""
        return not self.supports("slew_azm_pos")

    @property
    def equinox(self) -> str:  # type: ignore[override]
        """Equinox of its coordinates: J2000 up to 4.13 and on GTs, by Celestron's driver; other sources disagree."""
        if self.starsense or self.version is None or self.version >= JNOW_FROM:
            return self.default_equinox
        return "j2000"

    @property
    def default_equinox(self) -> str:  # type: ignore[override]
        return str(self.model_facts.get("equinox", "jnow"))

    @property
    def german(self) -> bool:  # type: ignore[override]
        return bool(self.model_facts["mount"] == "german")

    @property
    def axis_offset(self) -> float:
        """Degrees to add to the first axis of a German mount to get what a Celestron would read; 0 for a fork."""
        return POLE_AXES[0] - float(self.model_facts.get("index", POLE_AXES[0])) if self.german else 0.0

    def has_part(self, part: str) -> bool:
        return part in self.model_facts["has"] or part in self.found_parts

    @property
    def rate_table(self) -> Model:
        """The key speeds of the mount's family."""
        return rate_tables()[self.model_facts["rates"]]

    def key_speed(self, key: int) -> float:
        """Return the speed of a hand-control key (1-9), degrees a second."""
        return self.settings.rates[key - 1] if self.settings.rates else key_speed(self.rate_table, key)


def stop_command(axis: int) -> Send:
    """Return the command that ends hand motion of an axis."""
    return Send(f"slew_{MOTORS[axis]}_pos", {"rate": 0})


#: The motors of both axes in the names of commands.
MOTORS = {1: "azm", 2: "alt"}
_MOUNTING_UNKNOWN_TEXT = (
    "This mount is set up in alt-az or equatorially, and has not reported which: turn tracking on once at the hand "
    "control, or set the key mode."
)
#: The motors' own default guide rate, as a fraction of sidereal.
DEFAULT_GUIDE_RATE = 0.5
#: Keys that add to equatorial tracking (NexStar protocol, Slewing Commands, note).
GENTLE_KEYS = (1, 2)
#: Speeds count as equal within this difference: degrees a second; for guiding a fraction of the speed.
SPEED_TOLERANCE, GUIDING_TOLERANCE = 0.01, 0.02
#: The first motor firmware with guide pulses.
PULSE_FIRMWARE = (6, 12)
#: Axis readings of a German mount that points at the pole: both axes at their index.
POLE_AXES = (90.0, 90.0)
#: How far above the lowest altitude a fork is parked, degrees.
PARK_MARGIN = 0.5
