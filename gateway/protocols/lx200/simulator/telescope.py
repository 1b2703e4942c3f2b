"""The simulated Meade: a classic LX200 under or at 16 inches, an Autostar, an LX200GPS.

Bytes in, bytes out, at the time that the given clock shows; nothing sleeps. What it knows is what the manual gives that
model, what it answers is what real ones were seen to answer, quirks included. Where nobody has said:

- What takes a real one seconds or minutes (``:SC`` on a classic, ``:Aa`` and ``:gT`` on an LX200GPS) is answered late,
  and nothing else meanwhile, to a caller that gave ``later``; to any other it is done at once.
- A command with an argument that lost its ``#`` is refused with everything up to the next one, and nothing that comes
  with it sets the telescope moving.
- It answers after ``:hP#`` on every model, and any motion command takes a parked telescope into service.
- While an LX200GPS sleeps (``:hN#``) it answers as before, but its motors have no power: nothing turns until ``:hW#``
  or ``:I#``. It says yes (``0``) to ``:MS#`` and ``:MA#`` all the same.
- ``:GW#`` tells how the telescope stands, in land mode too (``PN1`` on a wedge). With ``land_tells_altaz`` it tells
  ``AN1`` there instead: nobody has seen what a real one does.
- An argument that the manual does not write so is refused and changes nothing. A ``tolerant`` one takes every spelling
  that the gateway's own surface takes.
- The classics and the Autostar begin in low precision, the LX200GPS in high.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gateway.astro.axes import Build, Pair, Sky
from gateway.astro.spherical import SIDEREAL_RATE, fold_declination, wrap180
from gateway.core.errors import UserError
from gateway.core.motion_kinds import may_begin_motion
from gateway.protocols.base.frames import Suspect, Unterminated
from gateway.protocols.lx200.framing import Framer
from gateway.protocols.lx200.simulator import answers, library, motion, settings
from gateway.protocols.lx200.simulator import parts as sim_parts
from gateway.protocols.lx200.simulator import tracking as sim_tracking
from gateway.protocols.lx200.simulator.forms import well_formed
from gateway.protocols.lx200.simulator.line import ClassicFramer
from gateway.protocols.mechanics.axis_motor import RAMP_SECONDS
from gateway.protocols.mechanics.mount import Mechanics
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load

Handler = Callable[["SimulatedLx200", str, dict[str, Any]], bytes | None]
#: Answers that come after a while: seconds, bytes.
Later = Callable[[float, bytes], None]

NAK = b"\x15"
#: What is understood while the telescope is busy with itself.
WHILE_BUSY = frozenset({"Q", "h?", "ACK"})
#: What turns a motor -> the answer of one whose motors have no power, because it sleeps.
TURNS_MOTORS: dict[str, bytes] = {
    **dict.fromkeys(("MS", "MA", "Aa"), b"0"), **dict.fromkeys(("Mn", "Ms", "Me", "Mw", "Mg", "hP", "hS", "hF"), b""),
}  # fmt: skip
#: Beyond the manual, yet known to these; other forms beyond it are known to none.
BEYOND = {
    "Mg": {"autostar", "lx200gps"}, "GW": {"autostar", "lx200gps"}, "GVF": {"autostar"}, "hI": {"lx200gps"},
    "TS": {"autostar", "lx200", "lx200-16", "lx200gps"}, "R": {"autostar", "lx200gps"},
}  # fmt: skip
#: A classic has no name to tell.
NAMELESS = {"GVP", "GVN", "GVD", "GVT", "GVF"}
HANDLERS: dict[str, Handler] = {
    **answers.HANDLERS, **library.HANDLERS, **motion.HANDLERS, **sim_parts.HANDLERS,
    **settings.HANDLERS, **sim_tracking.HANDLERS,
}  # fmt: skip
STARTS_HIGH = {"lx200gps"}
SITES = 4


class SimulatedLx200:
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
        self.row: dict[str, Any] = self.protocol.models[model]
        self.classic: bool = model in ("lx200", "lx200-16")
        self.clock: Callable[[], float] = clock
        self.now: float = clock()
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
        self.parked, self.asleep = False, False
        self.land_tells_altaz, self.tolerant = land_tells_altaz, tolerant
        build = Build.WEDGE if self.letter == "P" else Build.ALTAZ
        self.mechanics = Mechanics(build, Sky(*site), self.now, self.start(build))
        self.mechanics.speed = speed
        self.mechanics.acceleration = self.row["max_rate"] / RAMP_SECONDS if ramps else math.inf
        self.power_on()
        self._framer = self.framer()

    def power_on(self) -> None:
        """Formats, rates and target as they are after switching on; site, clock and names are remembered."""
        self.high: bool = self.model in STARTS_HIGH
        self.parts: dict[str, Any] = {}
        self.kept: dict[str, Any] = {"rate": "RC", "lowest": 0.0, "highest": 90.0}
        self.mechanics.fastest = float(self.row["max_rate"])
        self.mechanics.keep_up_with(self.now, SIDEREAL_RATE)
        self.parked = self.asleep = False
        self.track(self.aligned)

    # --- the line -------------------------------------------------------------------------------------------------

    def framer(self) -> Framer:
        return ClassicFramer() if self.classic else Framer()

    def feed(self, data: bytes, framer: Framer | None = None, later: Later | None = None) -> bytes:
        """Bytes from the port -> what the telescope answers to them now; ``later`` is given what comes afterwards."""
        self._come_to_now()
        return b"".join([self._answer(frame, later) for frame in (framer or self._framer).feed(data, self.now)])

    def connection(self, later: Later | None = None) -> Callable[[bytes], bytes]:
        """One more way in, for another program on the same telescope: its half commands are its own."""
        framer = self.framer()
        return lambda data: self.feed(data, framer, later)

    def _answer(self, frame: bytes, later: Later | None) -> bytes:
        if isinstance(frame, Unterminated):
            name = frame.names[0]
            return self._no(self.protocol.commands[name]) if name and self.knows(name) and not frame.late else b""
        found = self.protocol.find(frame)
        if found is None or not self.knows(found[0].name):
            return b""
        command, picture = found
        if self.busy and command.name not in WHILE_BUSY:
            return NAK if self.model == "lx200gps" else b""
        if isinstance(frame, Suspect) and may_begin_motion(self.protocol.surface[command.name].operations):
            return b""
        if not self.tolerant and not well_formed(command.name, frame):
            return self._no(command)
        try:
            values = picture.decode(frame)
        except ValueError:
            return self._no(command)
        if self.asleep and command.name in TURNS_MOTORS:
            return TURNS_MOTORS[command.name]
        reply = HANDLERS[command.name](self, command.name, values) or b""
        return self._take_time(command.name, reply, later)

    @staticmethod
    def _no(command: Command) -> bytes:
        """What it says to a value that it cannot read, where it says anything."""
        refusals = [form for reply, form in command.replies if reply.fault]
        return refusals[0].encode({}) if refusals and not refusals[0].fields else b""

    def _take_time(self, name: str, reply: bytes, later: Later | None) -> bytes:
        """Of a reply that takes its time, what comes at once; the rest follows when the telescope is free again."""
        seconds = settings.takes(self, name)
        if later is None or not seconds or reply == b"0":
            return reply
        self.busy_until = self.now + seconds
        first, mark, rest = reply.partition(b"#")
        later(seconds, rest if mark else first)
        return first + mark if mark else b""

    def knows(self, name: str) -> bool:
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

    def _come_to_now(self) -> None:
        """Let time pass: motion, and the end of a search for home."""
        self.now = self.clock()
        self.mechanics.advance(self.now)
        if self.seeking and not self.mechanics.slewing(self.now):
            self.seeking, self.home, self.aligned = False, 1, True
            self.mechanics.correct(self.now, (0.0, 0.0))

    # --- for whoever watches --------------------------------------------------------------------------------------

    def truth(self) -> Pair:
        """Right ascension and declination of date that the tube really points at."""
        self._come_to_now()
        return self.mechanics.truth(self.now)

    @property
    def tracking(self) -> bool:
        """Whether the telescope follows the sky at this moment."""
        self._come_to_now()
        return self.mechanics.tracking(self.now)

    @property
    def slewing(self) -> bool:
        """Whether a slew is under way."""
        self._come_to_now()
        return self.mechanics.slewing(self.now)
