"""The state of the driver between two operations: the identified telescope, its settings and its motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, Refused, Unsupported
from gateway.core.motion_kinds import MOVERS
from gateway.protocols.base.driver import SLEWING_MESSAGE, Driver, GotoUnderWay, Handler, SavedValues, Send, Steps, Wait
from gateway.protocols.base.spec import DriverSettings
from gateway.protocols.lx200.driver.speeds import SPEEDS, ModelSpeeds, nearest
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

BUSY_RETRIES, BUSY_WAIT = 5, 0.4  # seconds between them
#: Queries whose replies are true for one moment only, so that they are accepted without verification.
UNVERIFIED_QUERIES = frozenset({"GS", "Gr", "Gd"})
#: Stands for an unknown value of a rate register: it differs from every rate.
UNKNOWN_RATE = -1
_COMMAND_BY_RATE_NAME = {"guide": "RG", "center": "RC", "find": "RM", "max": "RS"}
#: The commands for product name and firmware; a telescope without a product name answers none of them.
NAME_COMMANDS = frozenset({"GVP", "GVN", "GVD", "GVT", "GVF"})
#: Timeout in seconds of commands that some firmware lacks: a telescope that has the command replies within it.
KNOWN_COMMAND_TIMEOUT = 1.5
PUSHED_MESSAGE = "This device only reports where the telescope points. You push it by hand."
#: Hand-control keys 1-9 as Meade's four rates.
_COMMAND_BY_KEY = {1: "RG", 2: "RG", 3: "RC", 4: "RC", 5: "RC", 6: "RM", 7: "RM", 8: "RS", 9: "RS"}


class Lx200GotoState(GotoUnderWay):
    """A goto under way. ``replies_without_bars``: how many replies to :D# in a row had no bars. ``position_read_at`` is
    when a position was last read, ``moved_at`` when the position last changed, and ``moved_to`` that position.
    """

    replies_without_bars: int = 0
    position_read_at: float = 0.0
    moved_at: float = 0.0
    moved_to: op.Equatorial | None = None


class ControllerReport(Struct, frozen=True):
    """The status that another maker's mount reports. ``moves``: an arrow or a pulse moves it; ``slews``: a goto or a
    search for home moves it, None if not reported. ``mounting``: as a Meade's letter, A, P or G, or None. ``side``: the
    pier side, E or W, or None. ``has_fault``: it has met a limit or reports an error.
    """

    tracks: bool
    parked: bool
    at_home: bool
    mounting: str | None
    side: str | None = None
    moves: bool = False
    slews: bool | None = None
    has_fault: bool = False


class Lx200Driver(Driver):
    """The driver's state of a Meade, or of another maker's mount by its dialect. ``now`` is monotonic seconds."""

    can_set_site_aligned = True
    silence_timeout = KNOWN_COMMAND_TIMEOUT
    #: The year has two digits on the wire; from 51 on they mean the 20th century.
    clock_years = range(1951, 2051)
    position_reads = 2

    def __init__(
        self,
        now: Callable[[], float],
        settings: DriverSettings = DriverSettings(),
        handlers: Mapping[str, Handler] = {},
    ) -> None:
        super().__init__(handlers)
        self.now, self.key_speeds = now, settings.rates  # speeds of keys 1 to 9, degrees per second, if configured
        self.named_model = settings.model
        self.assume_model(settings.model)
        self.product, self.firmware = "", ""
        #: Whether it replies in low precision; another maker's mount is then sent the low-precision form of a request.
        self.low = False
        # alignment and tracking
        self.mounting = "A"  # the mounting in :GW# or ACK: A, P or G
        #: Whether it is in land mode, in which it does not track.
        self.in_land_mode = False
        #: Whether it answers its status command, :GW# on a Meade.
        self.has_status = False
        #: The queries that it did not answer, or not in a known form; and how long a reply takes, seconds.
        self.unanswered: frozenset[str] = frozenset()
        self.reply_time = 0.0
        #: How many reads of azimuth and altitude in a row had no usable reply.
        self.missing_replies = 0
        #: Whether it has answered, but is not identified yet.
        self.contacted = False
        #: Commands that it has beyond those of its model: some that report a classic's name have more than a classic.
        self.extra_commands: frozenset[str] = frozenset()
        #: Whether it only reports the position of a telescope that the user pushes by hand.
        self.pushed_by_hand = False
        self.aligned = True
        self.tracking = op.Tracking.ALTAZ
        #: The drive rate that was requested last; None for the telescope's default.
        self.drive_rate: op.TrackRate | None = None
        # motion
        self.goto: Lx200GotoState | None = None
        self.moving: dict[int, str] = {}  # axis -> letter of the direction of a motion by hand
        self.pulsing: dict[int, str] = {}  # axis -> letter of a guide pulse that the gateway must end
        #: When the last pulse that the telescope times itself ends.
        self.pulses_end_at = -math.inf
        #: By axis of an alt-az mount, its part of the last pulse on the sky, signed milliseconds, and when it ends.
        self.pulse_shares: dict[int, tuple[float, float]] = {}
        self.focusing = False
        #: How many motions were begun on each axis; and for each end command sent, these numbers at that time.
        self.motions_begun: dict[int, int] = {}
        self.motions_at_end: dict[str, dict[int, int]] = {}
        #: The guide rate, a fraction of sidereal (a model with a fixed rate shortens pulses); whether the user set it.
        self.guide_rate, self.guide_rate_configured = settings.guide_rate or 1.0, settings.guide_rate is not None
        self.guide_rate_requested = False  # whether a client has set it
        #: The last value sent with :Sw, degrees per second; None before the first, ``UNKNOWN_RATE`` after a reset.
        self.max_speed_sent: int | None = None
        #: Axes with a rate of their own (:RA :RE); and the guide rate sent last (:Rg).
        self.axes_with_rate: set[int] = set()
        self.guide_rate_sent = 1.0
        #: Whether a motion in right ascension has changed the drive rate.
        self.drive_rate_changed = False
        # another maker's mount: its last status report, and when it came; the speeds it reported, degrees per second
        self.last_report: tuple[float, ControllerReport] | None = None
        self.reported_speeds: dict[str, float] = {}
        #: Rate commands: the one sent last; and those that the mount reported: for its guide pulses now, for its guide
        #: pulses before the gateway sent any rate, and for its keypad.
        self.rate_sent: str | None = None
        self.pulse_rate: str | None = None
        self.old_pulse_rate: str | None = None
        self.keypad_rate: str | None = None
        #: The drive rate displayed before a motion, maybe set at the hand control, hertz; and when it was read.
        self.drive_hertz_shown: float | None = None
        self.drive_rate_read_at = -math.inf
        self.reset_state()

    def reset_state(self) -> None:
        """Reset the values that no Meade reports, because the Meade was restarted, or perhaps switched off and on.

        A rate that the gateway had changed then counts as unknown, and is sent again before it is used.
        """
        #: Whether it seeks its home.
        self.seeking = False
        #: Whether it was put to sleep: its motors have no power, although it may accept a goto.
        self.powerless = False
        if self.max_speed_sent is not None:
            self.max_speed_sent = UNKNOWN_RATE
        if self.guide_rate_sent != 1.0:
            self.guide_rate_sent = float(UNKNOWN_RATE)
        #: The right ascension of the last goto, and when it began: by these a German mount chose its side of the pier.
        self.pier_side_basis: tuple[float, float] | None = None
        #: Whether its second axis is turned beyond the pole since then; None until this is computed.
        self.beyond_pole: bool | None = None
        #: The axes whose periodic error is corrected, as was requested.
        self.pec_axes: frozenset[int] = frozenset()

    def supports(self, command: str) -> bool:
        """Whether the telescope has a command: by the manual, or because the telescope has answered that command."""
        return command in self.extra_commands or super().supports(command)

    def assume_model(self, model: str | None) -> None:
        """Assume that the telescope is of this model (None: unknown), and use the command set of its dialect."""
        self.model, self.protocol = model, load("lx200").in_dialect_of(model)
        #: The facts of its dialect, none for a Meade; and the command for its state.
        self.dialect: Mapping[str, Any] = {} if self.protocol.dialect_rows is None else self.protocol.dialect_rows.facts
        self.status_command = str(self.dialect.get("status", {}).get("command", "GW"))

    @property
    def facts(self) -> Model:
        """Its row in ``models.toml``; an unknown telescope is driven as an Autostar."""
        return self.protocol.models[self.model or "autostar"]

    @property
    def rest_tolerance(self) -> float:  # type: ignore[override]
        """Degrees by which two positions may differ at rest: 20 arcseconds, in low precision 90 (0.1 minutes of RA)."""
        return (90.0 if self.low and not self.dialect else 20.0) / 3600.0

    @property
    def angle_steps(self) -> tuple[float, float]:  # type: ignore[override]
        return (90.0 / 3600.0, 60.0 / 3600.0) if self.low and not self.dialect else (15.0 / 3600.0, 1.0 / 3600.0)

    @property
    def gps(self) -> bool:  # type: ignore[override]
        return self.model == "lx200gps"

    @property
    def times_pulses(self) -> bool:  # type: ignore[override]
        return self.supports("Mg") and bool(self.product)

    @property
    def equatorial(self) -> bool:
        return self.mounting in "PG"

    def check_movable(self) -> None:
        """Raise Refused if the telescope has no motors: the user pushes it by hand."""
        if self.pushed_by_hand:
            raise Refused(PUSHED_MESSAGE)

    def certain_fault(self, operation: op.Operation) -> Fault | None:
        if self.pushed_by_hand and isinstance(operation, (*MOVERS, op.Sync)):
            return Refused(PUSHED_MESSAGE)
        if self.goto is not None and isinstance(operation, op.Pulse | op.PulseAxis):
            return Refused(SLEWING_MESSAGE)
        return None

    def presented_model(self) -> Model:
        """Return the row of its model, with the commands that it does not answer, such as those for its name.

        Programs for a Meade see an Autostar instead of another maker's mount.
        """
        if self.protocol.dialect:
            return {**self.protocol.models["autostar"], "name": "autostar"}
        lacking = {
            name for name, command in self.protocol.commands.items() if command.replies and not self.supports(name)
        }
        return {
            **self.facts,
            "name": self.model or "autostar",
            "own": True,
            "build": self.mounting,
            "lacking": frozenset(lacking if self.product else lacking | NAME_COMMANDS),
        }

    def reported_model(self, identity: op.Identity) -> str | None:
        rows = self.protocol.models
        fits = [name for name, row in rows.items() if self.product and self.product.startswith(row["product"])]
        if fits:
            return max(fits, key=lambda name: len(rows[name]["product"]))
        return "autostar" if self.product and not self.product.startswith("LX200") else None

    def contact(self) -> Steps:
        return (yield from self.handlers["identify.contact"](self, None))

    def native_reply(self, operation: op.NativeRequest) -> Steps:
        """Send a client's command unchanged and return the raw reply. Raises Busy while the telescope seeks its home,
        Unsupported if the model lacks the command, and Silence after a short wait, because firmware may lack it.
        """
        if self.seeking and not self.protocol.commands[operation.command].allowed_while_homing:
            raise Busy("The mount seeks its home.")
        if (self.protocol.dialect and operation.keep != "dialect") or not self.supports(operation.command):
            raise Unsupported
        values = {**dict(operation.fields), "low": self.low}
        return (yield Send(operation.command, values, KNOWN_COMMAND_TIMEOUT, include_raw=True))["raw"]

    def saved_state(self, moving: bool) -> SavedValues:
        """Return the values to save that no command can read, such as parked or a changed drive rate.

        In land mode the mounting is saved too, because some telescopes do not report it then.
        """
        stands = {"stands": self.mounting} if self.in_land_mode and self.equatorial else {}
        driven = {"driven": True} if self.drive_rate_changed else {}
        guides = {"guides": self.guide_rate} if self.guide_rate_requested else {}
        corrects = {"corrects": sorted(self.pec_axes)} if self.pec_axes else {}
        sent = {"rates": [self.rate_sent, self.old_pulse_rate, self.keypad_rate]} if moving and self.rate_sent else {}
        return {**stands, **({"parked": True} if self.parked else {}), **driven, **guides, **corrects, **sent}

    def restore_state(self, saved_values: SavedValues, moving: bool) -> None:
        self.parked, self.drive_rate_changed = saved_values.get("parked") is True, saved_values.get("driven") is True
        if saved_values.get("stands") in ("P", "G"):
            self.mounting = saved_values["stands"]
        if isinstance(guides := saved_values.get("guides"), float) and 0.0 < guides <= 1.0:
            self.guide_rate, self.guide_rate_sent = guides, float(UNKNOWN_RATE)
            self.guide_rate_configured = self.guide_rate_requested = True
        if moving and isinstance(rates := saved_values.get("rates"), list) and len(rates) == 3:
            self.rate_sent, self.old_pulse_rate, self.keypad_rate = (str(rate) if rate else None for rate in rates)
        if isinstance(corrects := saved_values.get("corrects"), list):
            self.pec_axes = frozenset({1, 2}.intersection(corrects))

    @property
    def stale_note(self) -> str:
        """A message that PEC counts as off after a power cycle; empty if it was off or can be set, not only toggled."""
        known = not self.pec_axes or self.supports("$QZ+")
        return "" if known else "its periodic error counts as not corrected"

    def renew_settings(self) -> Steps:
        yield from ()
        self.pec_axes = frozenset()

    @property
    def german(self) -> bool | None:  # type: ignore[override]
        """Whether it is a German mount: True for the letter G, False for A. For P, None if the model may be German,
        else False (a fork on a wedge).
        """
        return {"G": True, "A": False}.get(self.mounting, False if self.dialect or self.facts.get("fork") else None)

    @property
    def no_position_while_homing(self) -> bool:  # type: ignore[override]
        return not self.dialect

    @property
    def reports_pier_side(self) -> bool:  # type: ignore[override]
        return bool(self.dialect) and self.has_status

    def tube_side(self, reported_side: str) -> str | None:
        """Return the tube's pier side: the reported letter, swapped in the southern hemisphere; None if unknown."""
        if not (self.german and self.reports_pier_side and reported_side):
            return None
        return {"E": "W", "W": "E"}[reported_side] if self.southern else reported_side

    def speed(self, rate: op.Rate) -> float:
        """Return the speed at a hand rate, degrees per second; if several are possible, the greatest."""
        if rate.name is None and rate.degrees is not None:
            speed = nearest(self.model_speeds, rate.degrees).deg_per_s
            return max(min(rate.degrees, max(self.speeds.values())), speed) if rate.key is None else speed
        return self.key_speeds[rate.key - 1] if self.key_speeds and rate.key else self.speeds[rate_command(self, rate)]

    @property
    def speeds(self) -> Mapping[str, float]:
        """The speeds of its rate commands, degrees per second, as far as they are known."""
        table = self.dialect.get("speeds", {})
        known = {name: times * SPEEDS["RG"] for name, times in table.items() if isinstance(times, float)}
        return {**known, **self.reported_speeds} or SPEEDS

    def abilities(self, equatorial: bool) -> op.Abilities:
        can = super().abilities(equatorial)
        able = can.can - {kind.__name__ for kind in (*MOVERS, op.Sync)} if self.pushed_by_hand else can.can
        return replace(can, can=able, guides=(self.guide_rate, self.guide_rate))

    @property
    def model_speeds(self) -> ModelSpeeds:
        """The speeds that its model can run at, to choose the nearest from."""
        low, high = self.facts["max_rates"]
        slow, fast = self.facts["hertz"]
        return ModelSpeeds(
            self.supports("Rg"),
            self.supports("RA"),
            self.supports("Sw"),
            self.facts["max_rate"],
            (low, high),
            (slow, fast),
            tuple(sorted(self.speeds.items(), key=lambda speed: speed[1])) if self.dialect else (),
        )


def rate_command(mount: Lx200Driver, rate: op.Rate) -> str:
    """Return the rate command for a rate with a name or a hand-control key; for any other rate that of key 1."""
    if keys := mount.dialect.get("keys"):
        command: str = keys[rate.name or str(rate.key or 1)]
        return command if command in mount.speeds else max(mount.speeds, key=mount.speeds.__getitem__)
    return _COMMAND_BY_RATE_NAME[rate.name] if rate.name is not None else _COMMAND_BY_KEY[rate.key or 1]


def ask(mount: Lx200Driver, command: str, **values: object) -> Steps:
    """Send a command with these values and return the verified reply; raises what ``send_command`` raises."""
    return (yield from send_command(mount, command, values, False))


def send_command(
    mount: Lx200Driver,
    command: str,
    values: Mapping[str, object],
    unverified_ok: Callable[[Mapping[str, object]], bool] | bool,
) -> Steps:
    """Send a command, and verify the reply unless ``unverified_ok`` accepts it (see ``Send``). Retry a few times if the
    telescope is busy (NAK), unless the command begins a motion by hand.

    Raises Unsupported if the model lacks it, Busy during a search for home, and Refused if a sleeping mount would move.
    """
    if not mount.supports(command):
        raise Unsupported(f"This model does not have the command {command if command == 'ACK' else f':{command}#'}.")
    row = mount.protocol.commands[command]
    if row.answer_kind is None:
        mount.last_report = None
    if mount.seeking and not row.allowed_while_homing:
        raise Busy("The mount seeks its home.")
    if mount.powerless and row.allowed_while_asleep is False:
        raise Refused("The mount is asleep: wake it first.")
    patience = row.long or (KNOWN_COMMAND_TIMEOUT if row.may_be_silent else None)
    asked, once = {**values, "low": mount.low}, command in UNVERIFIED_QUERIES
    send = Send(command, asked, patience, row.long is not None, row.by_hand, once=once, unverified_ok=unverified_ok)
    for _ in range(0 if row.by_hand else BUSY_RETRIES):
        try:
            return (yield send)
        except Busy:
            yield Wait(BUSY_WAIT)
    return (yield send)
