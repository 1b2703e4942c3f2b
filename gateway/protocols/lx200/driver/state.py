"""What the driver knows of the Meade it has found, and what it remembers between two operations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from msgspec.structs import replace

from gateway.core.errors import Busy, Fault, Refused, Unsupported
from gateway.core.operations import Abilities as Can
from gateway.core.operations import Identity, Operation, Own, Pulse, PulseAxis, Rate, Tracking, TrackRate
from gateway.protocols.base.driver import SLEWING, Driver, GotoUnderWay, Handler, SavedValues, Send, Steps, Wait
from gateway.protocols.base.spec import DriverSettings
from gateway.protocols.lx200.driver.speeds import SPEEDS, Abilities, nearest
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model

BUSY_RETRIES, BUSY_WAIT = 5, 0.4
#: Questions whose answers belong to one moment alone: they are believed as they come.
ONCE = frozenset({"GS", "Gr", "Gd"})
#: Differs from every rate that may be wanted.
UNKNOWN = -1
_NAMES = {"guide": "RG", "center": "RC", "find": "RM", "max": "RS"}
#: What tells who it is; a nameless one is silent to them all.
NAMES = frozenset({"GVP", "GVN", "GVD", "GVT", "GVF"})
#: Seconds in which a telescope answers what it knows; its firmware may know less than its manual.
OWN_PATIENCE = 1.5
#: Hand-control keys 1-9 as Meade's four rates.
_KEYS = {1: "RG", 2: "RG", 3: "RC", 4: "RC", 5: "RC", 6: "RM", 7: "RM", 8: "RS", 9: "RS"}


class GotoState(GotoUnderWay):
    """``quiet`` is how often the bars have been empty."""

    quiet: int = 0


class Lx200Driver(Driver):
    """A Meade telescope. ``now`` is any clock that never goes back, in seconds."""

    protocol = load("lx200")
    takes_site_aligned = True
    patience = OWN_PATIENCE
    #: Two digits: from 51 on they are those of the century before.
    years = range(1951, 2051)
    position_reads = 2

    def __init__(
        self,
        now: Callable[[], float],
        settings: DriverSettings = DriverSettings(),
        handlers: Mapping[str, Handler] = {},
    ) -> None:
        super().__init__(handlers)
        self.now = now
        self.named_model = self.model = settings.model
        self.product, self.firmware = "", ""
        self.low = False
        # alignment and tracking
        self.home_letter = "A"
        #: It was put into land mode, in which it does not track.
        self.land = False
        self.tells_status = False
        #: The questions that it has not answered, or not in a form that is known; how long its answers take, seconds.
        self.mute: frozenset[str] = frozenset()
        self.quick = 0.0
        self.unanswered = 0
        #: It is known to be there, and not yet who it is.
        self.met = False
        #: The commands that it has beyond those of its model: some that tell a classic's name answer what that lacks.
        self.more: frozenset[str] = frozenset()
        self.aligned = True
        self.tracking = Tracking.ALTAZ
        #: The drive rate that was asked for last; None for its own.
        self.rate: TrackRate | None = None
        # motion
        self.goto: GotoState | None = None
        self.moving: dict[int, str] = {}
        self.pulsing: dict[int, str] = {}
        #: When the last pulse that the telescope times itself is over.
        self.pulses_until = -math.inf
        self.focusing = False
        #: How often each axis was set moving; and by the command that has ended it, how often it had been then.
        self.begun: dict[int, int] = {}
        self.ended: dict[str, dict[int, int]] = {}
        #: What is meant by it, a fraction of sidereal; on models that take none, pulses are so much shorter.
        self.guide_rate = settings.guide_rate or 1.0
        #: What :Sw was sent last, degrees a second; None before the first.
        self.fastest: int | None = None
        #: Axes with a rate of their own (:RA :RE); the guide rate sent last (:Rg).
        self.free_axes: set[int] = set()
        self.guides_at = 1.0
        #: A motion in right ascension has changed the drive rate.
        self.driven = False
        self.power_on()

    def power_on(self) -> None:
        """What no Meade tells, as after switching it on: that may have happened while the line was lost, or not.

        So a register that was changed may hold either value, and is sent before it is used again.
        """
        #: It seeks its home.
        self.seeking = False
        #: It was told to sleep: its motors have no power, though it may say yes to a goto.
        self.powerless = False
        if self.fastest is not None:
            self.fastest = UNKNOWN
        if self.guides_at != 1.0:
            self.guides_at = float(UNKNOWN)
        #: The right ascension of the last goto, and when it was begun: a German mount chose its side of the pier by it.
        self.side_by: tuple[float, float] | None = None
        #: Whether its second axis is turned over the pole since; None until it was worked out.
        self.beyond_pole: bool | None = None
        #: Whether it corrects periodic errors.
        self.corrects = False

    def supports(self, name: str) -> bool:
        """Whether it has a command, by the manual or because it was seen to answer it."""
        return name in self.more or super().supports(name)

    @property
    def facts(self) -> Model:
        """The row of models.toml; unknown telescopes are driven as an Autostar."""
        return self.protocol.models[self.model or "autostar"]

    @property
    def resolution(self) -> float:  # type: ignore[override]
        """A second of right ascension, or a tenth of its minute."""
        return (90.0 if self.low else 20.0) / 3600.0

    @property
    def gps(self) -> bool:  # type: ignore[override]
        return self.model == "lx200gps"

    @property
    def equatorial(self) -> bool:
        return self.home_letter in "PG"

    def impossible(self, operation: Operation) -> Fault | None:
        if self.goto is not None and isinstance(operation, Pulse | PulseAxis):
            return Refused(SLEWING)
        return None

    def presented(self) -> Model:
        """The row of its model, and what it does not answer: commands that it has not, and a name it cannot tell."""
        lacking = {
            name for name, command in self.protocol.commands.items() if command.replies and not self.supports(name)
        }
        return {
            **self.facts,
            "name": self.model or "autostar",
            "own": True,
            "build": self.home_letter,
            "lacking": frozenset(lacking if self.product else lacking | NAMES),
        }

    def reported_model(self, identity: Identity) -> str | None:
        rows = self.protocol.models
        fits = [name for name, row in rows.items() if self.product and self.product.startswith(row["product"])]
        if fits:
            return max(fits, key=lambda name: len(rows[name]["product"]))
        return "autostar" if self.product and not self.product.startswith("LX200") else None

    def own(self, operation: Own) -> Steps:
        """Firmware differs in what it knows: nobody waits long for an answer, and silence is one. Raises Busy."""
        if self.seeking and not self.protocol.commands[operation.command].while_seeking:
            raise Busy("The mount seeks its home.")
        if not self.supports(operation.command):
            raise Unsupported
        values = {**dict(operation.fields), "low": self.low}
        return (yield Send(operation.command, values, OWN_PATIENCE, raw=True))["raw"]

    def saved_state(self, moving: bool) -> SavedValues:
        """A telescope keeps its home itself, and stops by a command that all of them have.

        How it stands is remembered while its tracking is off: some do not tell it then.
        """
        stands = {"stands": self.home_letter} if self.land and self.equatorial else {}
        return {**stands, **({"parked": True} if self.parked else {}), **({"driven": True} if self.driven else {})}

    def restore_state(self, saved: SavedValues, moving: bool) -> None:
        self.parked, self.driven = saved.get("parked") is True, saved.get("driven") is True
        if saved.get("stands") in ("P", "G"):
            self.home_letter = saved["stands"]

    @property
    def german(self) -> bool | None:  # type: ignore[override]
        """The letter G says so; a P is a fork on a wedge or a German mount."""
        return {"G": True, "A": False}.get(self.home_letter)

    def speed(self, rate: Rate) -> float:
        """Degrees a second, at most, at a hand rate."""
        if rate.name is None and rate.degrees is not None:
            speed = nearest(self.abilities, rate.degrees).degrees
            return max(min(rate.degrees, SPEEDS["RS"]), speed) if rate.key is None else speed
        return SPEEDS[rate_command(rate)]

    def can_do(self, equatorial: bool) -> Can:
        return replace(super().can_do(equatorial), guides=(self.guide_rate, self.guide_rate))

    @property
    def abilities(self) -> Abilities:
        """What there is to choose a speed from."""
        low, high = self.facts["max_rates"]
        slow, fast = self.facts["hertz"]
        return Abilities(
            self.supports("Rg"),
            self.supports("RA"),
            self.supports("Sw"),
            self.facts["max_rate"],
            (low, high),
            (slow, fast),
        )


def rate_command(rate: Rate) -> str:
    """The one of the four rates that a name or a hand-control key stands for."""
    return _NAMES[rate.name] if rate.name is not None else _KEYS[rate.key or 1]


def ask(mount: Lx200Driver, command: str, **values: object) -> Steps:
    """Send a command; a busy telescope (NAK) is waited for, a few times, except with what moves it by hand.

    Raises Unsupported for what it lacks, and Refused for what would turn a motor of one that sleeps.
    """
    if not mount.supports(command):
        raise Unsupported(f"This model knows no {command if command == 'ACK' else f':{command}#'}.")
    row = mount.protocol.commands[command]
    if mount.seeking and not row.while_seeking:
        raise Busy("The mount seeks its home.")
    if mount.powerless and row.while_asleep is False:
        raise Refused("The mount is asleep: wake it first.")
    patience = row.long or (OWN_PATIENCE if row.may_be_silent else None)
    asked, once = {**values, "low": mount.low}, command in ONCE
    send = Send(command, asked, patience, row.long is not None, row.by_hand, once=once)
    for _ in range(0 if row.by_hand else BUSY_RETRIES):
        try:
            return (yield send)
        except Busy:
            yield Wait(BUSY_WAIT)
    return (yield send)
