"""The simulated Meade: a classic LX200 under or at 16 inches, an Autostar, an LX200GPS.

Bytes in, bytes out, at the time that the given clock shows; nothing sleeps. What it knows is what the manual gives that
model, what it answers is what real ones were seen to answer, quirks included: degree bytes of 0xDF, a classic that has
no name, an Autostar that says 0 to a good latitude, an LX200GPS that says NAK while it is busy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gateway.errors import UserError
from gateway.kinematics import Mechanics
from gateway.mount_geometry import Build, Pair, Sky
from gateway.protocols.lx200 import sim_answers, sim_motion, sim_settings
from gateway.protocols.lx200.framing import Framer
from gateway.spherical import fold_declination
from gateway.tables import load

Handler = Callable[["Meade", str, dict[str, Any]], bytes | None]
#: Answers that come after a while: seconds, bytes.
Later = Callable[[float, bytes], None]

NAK = b"\x15"
#: What is understood while the telescope is busy with itself.
WHILE_BUSY = frozenset({"Q", "h?", "ACK"})
#: Beyond the manual, yet known to these; other forms beyond it are known to none.
BEYOND = {
    "Mg": {"autostar", "lx200gps"}, "GW": {"autostar", "lx200gps"}, "GVF": {"autostar"}, "hI": {"lx200gps"},
    "TS": {"autostar", "lx200", "lx200-16", "lx200gps"}, "R": {"autostar", "lx200gps"},
}  # fmt: skip
#: A classic has no name to tell.
NAMELESS = {"GVP", "GVN", "GVD", "GVT", "GVF"}
HANDLERS: dict[str, Handler] = {**sim_answers.HANDLERS, **sim_motion.HANDLERS, **sim_settings.HANDLERS}
#: The classics and the Autostar begin in the short format.
STARTS_HIGH = {"lx200gps"}


class Meade:
    """One simulated telescope. ``site`` is latitude and longitude east in degrees, ``utc_offset`` local minus UTC.

    ``clock`` gives Unix seconds and is the only source of time. Raises UserError for a model that does not exist.
    """

    def __init__(self, model: str = "autostar", *, clock: Callable[[], float], site: Pair = (45.0, 10.0),
                 utc_offset: float = 0.0, aligned: bool = True, speed: float = 1.0) -> None:
        self.protocol = load("lx200")
        if model not in self.protocol.models:
            raise UserError(f"no LX200 model is called {model!r}; there are {', '.join(self.protocol.models)}")
        self.model: str = model
        self.row: dict[str, Any] = self.protocol.models[model]
        self.classic: bool = model in ("lx200", "lx200-16")
        self.clock: Callable[[], float] = clock
        self.now: float = clock()
        self.site: Pair = site
        self.ahead, self.offset = 0.0, utc_offset
        self.aligned: bool = aligned
        self.letter: str = "P" if self.classic else "A"
        self.high: bool = model in STARTS_HIGH
        self.kept: dict[str, Any] = {"rate": "RC", "site": 0, "names": {}, "sites": {}, "lowest": 0.0, "highest": 90.0}
        self.arrows: set[int] = set()
        self.busy_until = 0.0
        self.parked, self.home = False, 0
        build = Build.WEDGE if self.letter == "P" else Build.ALTAZ
        start = (180.0 if site[0] >= 0 else 0.0, 0.0 if build is Build.WEDGE else 45.0)
        self.mechanics = Mechanics(build, Sky(*site), self.now, start)
        self.mechanics.speed, self.mechanics.fastest = speed, float(self.row["max_rate"])
        if aligned:
            self.track(True)
        self._framer = Framer()

    # --- the line -------------------------------------------------------------------------------------------------

    def feed(self, data: bytes, framer: Framer | None = None, later: Later | None = None) -> bytes:
        """Bytes from the port -> what the telescope answers to them now; ``later`` is given what comes afterwards."""
        self.now = self.clock()
        self.mechanics.advance(self.now)
        return b"".join([self._answer(frame, later) for frame in (framer or self._framer).feed(data)])

    def connection(self, later: Later | None = None) -> Callable[[bytes], bytes]:
        """One more way in, for another program on the same telescope: its half commands are its own."""
        framer = Framer()
        return lambda data: self.feed(data, framer, later)

    def _answer(self, frame: bytes, later: Later | None) -> bytes:
        found = self.protocol.find(frame)
        if found is None or not self.knows(found[0].name):
            return b""
        command, picture = found
        if self.now < self.busy_until and command.name not in WHILE_BUSY:
            return NAK if self.model == "lx200gps" else b""
        try:
            values = picture.decode(frame)
        except ValueError:
            refusals = [form for reply, form in command.replies if reply.fault]
            return refusals[0].encode({}) if refusals and not refusals[0].fields else b""
        reply = HANDLERS[command.name](self, command.name, values)
        if command.name == "SC" and reply and later is not None and self.classic:
            first, _, second = reply.partition(b"#")
            later(sim_settings.PLANETS, second)
            return first + b"#"
        return reply or b""

    def knows(self, name: str) -> bool:
        """Whether this model has a command: by the manual, else by what real ones do."""
        command = self.protocol.commands[name]
        if command.beyond:
            return self.model in BEYOND.get(name, ())
        if name in NAMELESS and self.classic:
            return False
        return command.known_to(self.model, None)

    # --- what it is -----------------------------------------------------------------------------------------------

    def utc(self) -> float:
        """The telescope's own clock, Unix seconds."""
        return self.now + self.ahead

    def track(self, on: bool) -> None:
        """Follow the sky, or stand still."""
        self.mechanics.track(self.now, on, self.mechanics.geometry.pole)

    def relocate(self) -> None:
        """After a new site or time."""
        self.mechanics.relocate(self.now, Sky(*self.site, self.ahead))

    def position(self) -> Pair:
        """Right ascension and declination of date, as the telescope believes."""
        return fold_declination(*self.mechanics.believed(self.now))

    # --- for whoever watches --------------------------------------------------------------------------------------

    def truth(self) -> Pair:
        """Right ascension and declination of date that the tube really points at."""
        self.now = self.clock()
        return self.mechanics.truth(self.now)

    @property
    def tracking(self) -> bool:
        self.now = self.clock()
        return self.mechanics.tracking(self.now)

    @property
    def slewing(self) -> bool:
        self.now = self.clock()
        return self.mechanics.slewing(self.now)
