"""A Celestron hand control with a mount on it: bytes of the serial port in, bytes out.

It answers as the chosen model and version does, at the present time of the clock it is given; latency is the
business of whoever carries the bytes. Where the manual is silent:

- A command this version lacks is heard whole, by the length it has elsewhere, and passed over in silence; a byte
  that begins no command makes it deaf until the line has been quiet for a tenth of a second.
- A hand rate overrides tracking. When it ends, tracking stays suspended until ``T``, the end of a goto, or
  the hand control's own restoring: after 20 s without a byte from the port, on alt-az mounts at the latest
  30 s after the rate was given. Stopping an axis that is not moved by hand changes nothing.
- The sky over it is that of the site and clock it was told; its GPS unit keeps the true place and time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from gateway.astro.axes import Build, Pair, Sky
from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.core.errors import UserError
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.nexstar.framing import Framer
from gateway.protocols.nexstar.simulator.clock import CLOCKS, GPS, RTC, Handler
from gateway.protocols.nexstar.simulator.commands import ALTAZ, COMMANDS, EQ_NORTH, EQ_SOUTH, OFF
from gateway.protocols.nexstar.simulator.devices import ALT, AZM, DEVICES, FOCUSER, FocuserMotor
from gateway.protocols.nexstar.versions import STARSENSE, STARSENSE_LONG_MODE, numbered
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Version, parse_version

HANDLERS: dict[str, Handler] = {**COMMANDS, **CLOCKS, **DEVICES}

RESTORE_WHEN_QUIET, RESTORE_ALTAZ = 20.0, 30.0
AWAKE_OR_NOT = b"yKV"
GERMAN_START: Pair = (90.0, 90.0)
PASS_THROUGH = ord("P")


class SimulatedHandControl:
    """One simulated mount. ``site`` is latitude and longitude east in degrees, ``utc_offset`` in hours.

    ``clock`` gives Unix seconds and is the only source of time. ``version`` is as the manual writes it, or
    ``starsense-1.20``; without one it is the model's newest. ``wedge`` puts a fork on one. The motors gather
    and lose speed as real ones do; with ``ramps`` False they change it at once, for whoever reckons with plain
    rates. Raises UserError for a model or version that does not exist.
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
        self.row: dict[str, Any] = protocol.models[model]
        self._know_version(version, starsense)
        self._protocol = protocol
        self._opcodes, self._pass_through = _known(model, self.version)
        self._framer = Framer()
        self.clock: Callable[[], float] = clock
        self.now: float = clock()
        self._heard = self.now
        rates = protocol.extra("rates.toml")[self.row["rates"]]
        self.keys = [*(times * SIDEREAL_RATE for times in rates["sidereal"]), *rates["degrees"]]
        self.motors = parse_version(self.row["motors"])
        self.settings: dict[tuple[str, int], int] = {}
        self.focuser = FocuserMotor() if focuser else None
        self.site: Pair = site
        self.zone, self.daylight, self.rtc_ahead = utc_offset, 0, 0.0
        self.aligned: bool = aligned
        self.asleep, self.mode = False, OFF
        self._set_up(wedge, rates["fastest"], speed, ramps)

    def _know_version(self, version: str | None, starsense: bool) -> None:
        """What ``V`` shows, and which commands are known for it."""
        try:
            number = numbered(version or (STARSENSE if starsense else self.row["versions"][-1]))
            self.shown_version: tuple[int, int] = (number.shown[0], number.shown[1])
        except (ValueError, IndexError):
            raise UserError(f"{version!r} is no hand-control version: 4.21 or starsense-1.20 are") from None
        if not all(0 <= part <= 255 for part in self.shown_version):
            raise UserError(f"{version!r} is no hand-control version: 4.21 or starsense-1.20 are")
        self.starsense: bool = number.starsense
        self.version: Version = number.counts_as
        first, last = self.row.get("shifted", ("1.0", "0.0"))
        self.shifted = parse_version(first) <= self.version <= parse_version(last)

    def _set_up(self, wedge: bool, fastest: float, speed: float, ramps: bool) -> None:
        """Point somewhere sensible: a fork at the equator's highest point, a German mount at the pole."""
        build = Build.GERMAN if self.german else Build.WEDGE if wedge else Build.ALTAZ
        north = self.site[0] >= 0
        start = GERMAN_START
        if not self.german:
            start = 180.0 if north else 0.0, 45.0 if build is Build.ALTAZ else 0.0
        self.mechanics: Mechanics = Mechanics(build, Sky(*self.site), self.now, start)
        self.mechanics.fastest, self.mechanics.speed = fastest, speed
        self.mechanics.acceleration = fastest / RAMP_SECONDS if ramps else math.inf
        self.encoder_offset = [0.0, 0.0]
        if self.aligned:
            self.track(ALTAZ if build is Build.ALTAZ else EQ_NORTH if north else EQ_SOUTH)
        else:
            self.encoder_offset = [-start[0], -start[1]]
            self.mechanics.correct(self.now, (-start[0], -start[1]))

    # --- the line ---------------------------------------------------------------------------------------

    def feed(self, data: bytes, framer: Framer | None = None) -> bytes:
        """Bytes from the port -> what the hand control answers to them now."""
        self._come_to_now()
        if data:
            self._heard = self.now
        return b"".join([self._answer(frame) for frame in (framer or self._framer).feed(data, self.now)])

    def connection(self, later: Callable[[float, bytes], None] | None = None) -> Callable[[bytes], bytes]:
        """One more way in, for another program on the same mount: its half commands are its own.

        ``later`` is for simulators some of whose answers come after a while; a hand control has none such.
        """
        framer = Framer()
        return lambda data: self.feed(data, framer)

    def _answer(self, frame: bytes) -> bytes:
        if frame[0] not in self._opcodes or (self.asleep and frame[0] not in AWAKE_OR_NOT):
            return b""
        if frame[0] == PASS_THROUGH:
            return self._pass(frame)
        found = self._protocol.find(frame)
        try:
            if found is None:
                raise ValueError(f"{frame!r} has the length of a command but not its form")
            command, picture = found
            values = HANDLERS[command.name](self, picture.decode(frame)) or {}
        except ValueError:
            return b"#"  # acknowledged, not carried out
        if command.name == "t" and self.starsense and self.shown_version == STARSENSE_LONG_MODE:
            return bytes((values["mode"], *self.shown_version)) + b"#"
        return command.replies[0][1].encode(values)

    def _pass(self, frame: bytes) -> bytes:
        """``P``: the device's answer, cut or filled to what was asked for; one byte more without one."""
        count, device, number, asked = frame[1], frame[2], frame[3], frame[7]
        table = self._pass_through
        rows = table.get((count, device, number)) or table.get((count, None, number))
        if rows and self.present(device):
            command, resp = next((row for row in rows if row[1] == asked), rows[0])
            data = frame[4 : 3 + count]
            values = command.request.decode(frame[:4] + data + bytes(3 - len(data)) + bytes((resp,)))
            answer = HANDLERS[command.name](self, values)
            if answer is not None:
                return (command.replies[0][1].encode(answer)[:-1] + bytes(asked))[:asked] + b"#"
        return bytes(asked + 1) + b"#"

    # --- what the commands use --------------------------------------------------------------------------

    @property
    def german(self) -> bool:
        return bool(self.row["mount"] == "german")

    def utc(self) -> float:
        """The hand control's own time, Unix seconds."""
        return self.now + self.mechanics.sky.ahead

    def encoders(self) -> Pair:
        """Motor positions as the hand control counts them, degrees."""
        first, second = self.mechanics.axes(self.now)
        return wrap360(first + self.encoder_offset[0]), wrap180(second + self.encoder_offset[1])

    def present(self, device: int) -> bool:
        """Whether the device is on this mount's bus."""
        has = self.row["has"]
        return device in (AZM, ALT) or (device, True) in (
            (GPS, "gps" in has),
            (RTC, "rtc" in has),
            (FOCUSER, self.focuser is not None),
        )

    def track(self, mode: int) -> None:
        """Tracking in that mode, which the hand control keeps in mind."""
        self.mode = mode
        if mode != OFF and not self.german:
            self.mechanics.rebuild(self.now, Build.ALTAZ if mode == ALTAZ else Build.WEDGE)
        self.mechanics.track(self.now, mode != OFF, sense=-1 if mode == EQ_SOUTH else 1)

    def relocate(self, sky: Sky) -> None:
        """Another site or clock. A StarSense loses its alignment over it."""
        self.mechanics.relocate(self.now, sky)
        if self.starsense and self.aligned:
            self.aligned = False
            self.mechanics.cancel(self.now)
            self.track(OFF)

    # --- read-only view ---------------------------------------------------------------------------------

    def truth(self) -> Pair:
        """Right ascension and declination of date that the tube really points at, degrees."""
        self._come_to_now()
        return self.mechanics.truth(self.now)

    @property
    def tracking(self) -> bool:
        """Whether the mount follows the sky at this moment."""
        self._come_to_now()
        return self.mechanics.tracking(self.now)

    @property
    def slewing(self) -> bool:
        """Whether a goto is under way."""
        self._come_to_now()
        return self.mechanics.slewing(self.now)

    def _come_to_now(self) -> None:
        """Let time pass, and the hand control restore its tracking when that is due."""
        self.now = self.clock()
        since = self.mechanics.suspended_since
        if since is not None and self.mode != OFF and not self.asleep:
            due = self._heard + RESTORE_WHEN_QUIET
            if self.mechanics.build is Build.ALTAZ:
                due = min(due, since + RESTORE_ALTAZ)
            if due <= self.now:
                self.mechanics.resume(due)


#: (length, device or None for any, command) -> pass-through rows and the reply bytes they ask for.
PassThrough = dict[tuple[int, int | None, int], list[tuple[Command, int]]]


@cache
def _known(model: str, version: Version) -> tuple[frozenset[int], PassThrough]:
    """The first bytes of the commands that a model of this version has, and its pass-through commands."""
    known = [row for row in load("nexstar").commands.values() if row.known_to(model, version)]
    return frozenset(row.request.literal[0] for row in known), _by_device(known)


def _by_device(known: list[Command]) -> PassThrough:
    """The pass-through rows among them, by what stands in the request."""
    found: PassThrough = {}
    for command in known:
        if command.request.literal[0] == PASS_THROUGH:
            frame = command.request.encode(dict.fromkeys(command.request.fields, 0))
            device = None if "device" in command.request.fields else frame[2]
            found.setdefault((frame[1], device, frame[3]), []).append((command, frame[7]))
    return found
