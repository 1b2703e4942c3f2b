"""The simulated OnStepX and TeenAstro, German mounts: their answers that differ from a Meade's.

They begin at home, at the pole with the counterweight down. As after power-on (not ``aligned``) they do not track, an
OnStep waits in standby for date and time, and a TeenAstro has no park position. A frame is everything between a colon
and a hash; ACK counts only outside a frame. An OnStep answers 0 to every command that it does not know.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial

from gateway.astro.axes import Pair
from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator import answers, motion, settings, tracking
from gateway.protocols.lx200.simulator.server import SimulatedLx200
from gateway.protocols.mechanics.simulated import Later, TimedFramer
from gateway.protocols.wireformat import sexagesimal

ACK, HASH = b"\x06", ord("#")
IGNORED = b" \r\n\x06"
HOME: Pair = (90.0, 90.0)
#: Seconds after which an OnStep ends an arrow, as delivered; its rates R0 to R7, and those of a TeenAstro, R0 to R3.
ARROW_ENDS = 10.0
ONSTEP_RATES, TEEN_RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 48.0), (0.5, 4.0, 16.0, 64.0)
#: The letters of rates in these lists.
ONSTEP_NAMES, TEEN_NAMES = {"G": 2, "C": 5, "M": 6, "F": 7, "S": 8}, {"G": 0, "C": 1, "M": 2, "S": 3}


class FrameCutter:
    """Cuts frames as these controllers do. With ``any_first`` (OnStep) any first byte counts as a colon, and a frame
    that is too long is shortened; a TeenAstro drops such a frame.
    """

    def __init__(self, longest: int, any_first: bool) -> None:
        self._longest, self._any_first, self._frame = longest, any_first, bytearray()

    def feed(self, data: bytes, now: float) -> list[bytes]:
        frames = []
        for byte in data:
            if byte == ACK[0] and not self._frame:
                frames.append(ACK)
            elif byte not in IGNORED:
                self._frame = self._frame[: self._longest - 1] + bytes((byte,))
            if byte == HASH:
                first = self._frame[:1]
                if first == b":":
                    whole = len(self._frame) > 2 and (self._any_first or len(self._frame) < self._longest)
                else:
                    whole = self._any_first and first != b"#"
                if whole:
                    frames.append(bytes(self._frame))
                self._frame.clear()
        return frames


class Controller(SimulatedLx200):
    """The state of an OnStepX or TeenAstro, by its model, and its motions."""

    @property
    def onstep(self) -> bool:
        return self.model == "onstep"

    @property
    def older(self) -> bool:
        """Whether it is an OnStep before OnStepX."""
        return str(self.row["firmware"])[:2] in ("2.", "3.", "4.")

    def power_on(self) -> None:
        super().power_on()
        self.high, self.degree, self.tolerant = True, b"*", True
        self.park_place: Pair | None = HOME if self.onstep or self.aligned else None
        self.standby: set[str] = {"SL", "SC"} if self.onstep and not self.aligned else set()
        self.parking = self.homing = False
        self.at_home = not self.aligned
        self.rate, self.pulse_rate = (6, 2) if self.onstep else (3, 0)
        self.separate_pulses = True
        self.ends: dict[int, float] = {}
        self.error = 0
        self.stored.update(lowest=-10.0, highest=90.0)

    def framer(self) -> TimedFramer:  # type: ignore[override]
        return FrameCutter(79 if self.onstep else 28, self.onstep)

    def times(self, number: int) -> float:
        """Return the speed of a rate number (R0 to R9) in multiples of the sidereal rate."""
        rates, fastest = ONSTEP_RATES if self.onstep else TEEN_RATES, self.mechanics.fastest / SIDEREAL_RATE
        return rates[number] if number < len(rates) else fastest / 2 if self.onstep and number == 8 else fastest

    def advance_to_now(self) -> None:
        now = self.clock()
        for axis, ends in sorted(self.ends.items(), key=lambda item: item[1]):
            if ends <= now:
                self.let_go(ends, axis)
        super().advance_to_now()
        if (self.parking or self.homing) and not self.mechanics.slewing(self.now):
            self.parked, self.at_home = self.parking, self.homing
            self.parking = self.homing = False

    def let_go(self, now: float, *axes: int) -> None:
        for axis in axes:
            if self.ends.pop(axis, None) is not None:
                self.mechanics.move(now, axis, 0.0)
        if not self.ends and axes:
            self.mechanics.resume(now)

    # --- what it does ---------------------------------------------------------------------------------------------

    def select(self, letter: str) -> bytes:
        """:R0 to :R9, :RG :RC :RM :RF :RS - select the rate of motion by hand."""
        names = ONSTEP_NAMES if self.onstep else TEEN_NAMES
        self.rate = names[letter] if letter in names else int(letter)
        if self.rate <= 2 and self.onstep and self.separate_pulses:
            self.pulse_rate = self.rate
        return b""

    def switch(self, on: bool) -> bytes:
        """:Te :Td - turn tracking on or off."""
        if self.parked or self.standby or (not on and self.onstep and (self.mechanics.slewing(self.now) or self.ends)):
            return b"0"
        self.at_home = self.at_home and not on
        self.track(on)
        return b"1"

    def refusal(self, height: float) -> bytes | None:
        """Return the reply that refuses a goto to this altitude, degrees; None if it is allowed."""
        reasons = {
            b"3": bool(self.standby),
            b"4": self.parked,
            b"5": self.mechanics.slewing(self.now),
            b"8" if self.onstep else b"7": bool(self.ends),
            b"1": height < self.stored["lowest"],
            b"2" if self.onstep else b"8 ": height > self.stored["highest"],
        }
        return next((digit.strip() for digit, holds in reasons.items() if holds), None)

    def go(self, ra: float, dec: float, height: float) -> bytes:
        if (no := self.refusal(height)) is not None:
            return no
        self.at_home = False
        self.mechanics.goto_sky(self.now, ra, dec)
        self.track(True)
        return b"0"

    def leave(self, goal: Pair | None, parks: bool) -> bytes:
        """Go to the park or home position with tracking off; reply 0 if that is impossible now, else 1."""
        if goal is None or self.parked or self.standby or self.mechanics.slewing(self.now) or self.ends:
            return b"0"
        self.track(False)
        self.parking, self.homing = parks, not parks
        self.mechanics.goto_axes(self.now, *goal)
        return b"1"

    def unpark(self) -> bytes:
        """:hR - unpark."""
        if self.onstep and not self.parked:
            return b"0"
        if self.parked:
            self.parked = False
            self.track(True)
        return b"1"

    def declare_home(self) -> bytes:
        """:hF - declare the present position of the tube to be home."""
        position = self.mechanics.axes(self.now)
        self.mechanics.correct(self.now, (wrap180(HOME[0] - position[0]), wrap180(HOME[1] - position[1])))
        self.track(False)
        self.at_home = True
        return b"" if self.onstep else b"1"

    @property
    def west(self) -> bool:
        """Whether the tube is on the west side of the pier."""
        return self.mechanics.flipped is (self.mechanics.geometry.pole > 0)

    def letters(self) -> bytes:
        """:GU - the state in letters."""
        flags = {
            "n": not self.mechanics.tracking(self.now) and not self.mechanics.slewing(self.now),
            "N": not self.mechanics.slewing(self.now),
            "p": not (self.parked or self.parking), "I": self.parking, "P": self.parked, "H": self.at_home,
            "h": self.homing, "G": any(self.mechanics.pulsing(self.now, axis) for axis in (1, 2)), "g": bool(self.ends),
            "(": self.stored.get("hertz") == 57.9, "O": self.stored.get("hertz") == 60.0, "E": True,
            "o": self.at_home, "W": not self.at_home and self.west,
            "T": not self.at_home and not self.west,
        }  # fmt: skip
        letters = "".join(letter for letter, holds in flags.items() if holds)
        return f"{letters}{self.pulse_rate}{self.rate}{self.error}#".encode()

    def state(self) -> bytes:
        """:GW - mounting, tracking and alignment."""
        place = "H" if self.at_home else "P" if self.parked else "1"
        tracks = self.mechanics.tracking(self.now) or (self.mechanics.slewing(self.now) and not self.parking)
        return f"G{'T' if tracks else 'N'}{place}#".encode()

    def side(self) -> bytes:
        """:Gm - the pier side; a TeenAstro sends two hashes."""
        letter = "W" if self.west else "E"
        return f"{letter}#".encode() if self.onstep else f"{letter}##".encode()

    def hertz(self) -> bytes:
        """:GT - the tracking rate, hertz."""
        on = self.mechanics.tracking(self.now)
        return f"{self.stored.get('hertz', 60.16427):.5f}#".encode() if on else b"0#" if self.onstep else b"0.00000#"


# --- the commands that a Meade does not have, or answers otherwise ----------------------------------------------------


def _slew(sim: Controller, name: str, _: Values) -> bytes:
    ra, dec = sim.stored.get("ra", 0.0), sim.stored.get("dec", 0.0)
    if name == "MA":
        ra, dec = motion.from_horizon(sim)
    return sim.go(ra, dec, motion.altitude(sim, ra, dec))


def _sync(sim: Controller, _: str, __: Values) -> bytes:
    if (no := sim.refusal(0.0)) is not None:
        return b"E" + no + b"#" if sim.onstep else b""
    motion.sync(sim, "CM", {})
    sim.at_home = False
    return b"N/A#"


def _arrow(sim: Controller, name: str, _: Values) -> None:
    axis, sense = motion.axis_of(sim, name[1])
    if sim.parked or sim.standby:
        return
    if sim.mechanics.slewing(sim.now):
        sim.mechanics.cancel(sim.now)
        return
    if sim.stored.get(f"arrow {axis}") == name and axis in sim.ends:
        return
    sim.at_home, sim.stored[f"arrow {axis}"] = False, name
    sim.ends[axis] = sim.now + ARROW_ENDS if sim.onstep else math.inf
    sim.mechanics.move(sim.now, axis, sense * sim.times(sim.rate) * SIDEREAL_RATE, gentle=True)


def _let_go(sim: Controller, name: str, _: Values) -> None:
    sim.let_go(sim.now, motion.axis_of(sim, name[1])[0])


def _stop(sim: Controller, _: str, __: Values) -> None:
    sim.let_go(sim.now, *sim.ends)
    sim.mechanics.cancel(sim.now)
    sim.parking = sim.homing = False


def _pulse(sim: Controller, _: str, values: Values) -> None:
    if sim.parked or sim.standby or sim.mechanics.slewing(sim.now):
        return
    axis, sense = motion.axis_of(sim, values["direction"])
    rate = sim.pulse_rate if sim.separate_pulses else sim.rate
    sim.mechanics.pulse(sim.now, axis, sense * sim.times(rate) * SIDEREAL_RATE, values["ms"] / 1000.0)


def _drive(sim: Controller, name: str, _: Values) -> None:
    tracking.drive(sim, name, _)
    sim.stored["hertz"] = {"TQ": 60.16427, "TS": 60.0, "TL": 57.9}[name]


def _set_drive(sim: Controller, _: str, values: Values) -> bytes:
    if not 30.0 <= values["hertz"] < 90.0:
        return b"0"
    sim.stored["hertz"] = values["hertz"]
    sim.mechanics.set_drive_rate(sim.now, values["hertz"] / 60.16427 * SIDEREAL_RATE)
    return sim.switch(True) if sim.onstep else b"1"


def _zone(sim: Controller, _: str, values: Values) -> bytes:
    """:SG - the clock goes on in UTC. A TeenAstro reads a number, as far as it goes."""
    offset = values["offset"]
    if not -14.0 < offset <= 12.0 or (sim.onstep and round(offset % 1 * 60) not in (0, 30, 45)):
        return b"0"
    if not sim.onstep and offset < -12.0:
        return b"0"
    sim.offset = -offset
    return b"1"


def _tell_zone(sim: Controller, _: str, __: Values) -> bytes:
    hours, minutes = divmod(round(abs(sim.offset) * 60), 60)
    sign = "-" if sim.offset > 0 else "+"
    return (f"{sign}{hours:02d}:{minutes:02d}#" if sim.onstep else f"{-sim.offset:+05.1f}#").encode()


def _set_clock(sim: Controller, name: str, values: Values) -> bytes:
    sim.standby.discard(name)
    if not sim.standby and sim.onstep:
        sim.aligned = True
    if name == "SXT2":
        sim.ahead = values["unix"] - sim.now
        sim.relocate()
    elif name == "SC" and not sim.onstep:
        sim.ahead += (values["date"] - datetime.fromtimestamp(sim.utc(), UTC).date()) / timedelta(seconds=1)
        sim.relocate()
    else:
        settings.HANDLERS[name](sim, name, values)
    return b"1"


def _site(sim: Controller, name: str, values: Values) -> bytes:
    if not (sim.onstep or sim.at_home or sim.parked):
        return b"0"
    settings.set_half(sim, name, values)
    return b"1"


def _tell_site(sim: Controller, name: str, _: Values) -> bytes:
    return answers.form(sim, name, latitude=sim.site[0], longitude=wrap180(-sim.site[1]))


def _horizon(sim: Controller, name: str, _: Values) -> bytes:
    return answers.horizon(sim, name, _).replace(b":", b"'")


def _fine(sim: Controller, name: str) -> bytes:
    """:GRa :GDe :GRL :GDL - in high precision at all times. :GtH :GgH - with seconds and their thousandths."""
    if (template := sim.protocol.commands[name[:2]].form("fine")) is not None and name[1] in "RD":
        return template.encode(dict(zip(("ra", "dec"), sim.position(), strict=True)))
    text = sexagesimal.signed(sim.site[0]) if name == "GtH" else "+" + sexagesimal.azimuth(-sim.site[1] % 360.0)
    return text.encode() + b".000#"


def _toggle(sim: Controller) -> bytes:
    """:U - unknown to an OnStepX."""
    if sim.onstep and not sim.older:
        return b"0"
    sim.high = not sim.high
    return b""


def _set_park(sim: Controller) -> bytes:
    sim.park_place = sim.mechanics.axes(sim.now)
    return b"1"


#: Commands of the next table that only an OnStep has, and that only a TeenAstro has.
OF_ONSTEP = {"GU", "GX90", "GX97", "GtH", "GgH", "GRa", "GDe"}
OF_TEENASTRO = {"GXT2", "GXRX", "GRL", "GDL"}
#: Commands without an argument that a Meade does not have or answers otherwise.
WORDS: dict[str, Callable[[Controller], bytes]] = {
    "GU": Controller.letters, "GW": Controller.state, "Gm": Controller.side,
    "GT": Controller.hertz, "Te": lambda sim: sim.switch(True), "Td": lambda sim: sim.switch(False),
    "U": _toggle, "hQ": _set_park, "hP": lambda sim: sim.leave(sim.park_place, True), "hR": Controller.unpark,
    "hC": lambda sim: b"" if sim.leave(HOME, False) and sim.onstep else b"1", "hF": Controller.declare_home,
    "GXT2": lambda sim: f"{sim.utc():.0f}#".encode(), "GXRX": lambda sim: f"{sim.times(4):.0f}#".encode(),
    "GX97": lambda sim: f"{sim.mechanics.fastest:.1f}#".encode(),
    "GX90": lambda sim: f"{sim.times(sim.pulse_rate):.2f}#".encode(),
    **{name: partial(_fine, name=name) for name in ("GtH", "GgH", "GRa", "GDe", "GRL", "GDL")},
    "Gh": lambda sim: f"{sim.stored['lowest']:+03.0f}*#".encode(),
    "Go": lambda sim: f"{sim.stored['highest']:02.0f}*#".encode(),
    **{f"R{letter}": partial(Controller.select, letter=letter) for letter in "GCMFS0123456789"},
}  # fmt: skip
TARGETS, SEPARATORS = ("Sr", "Sd", "Sa", "Sz"), re.compile(rb"[*:'\xdf]")
HANDLERS: dict[str, Callable[[Controller, str, Values], bytes | None]] = {
    **{name: answers.HANDLERS[name] for name in ("D", "GD", "GR", "Gd", "Gr", "GVD", "GVN", "GVP", "GVT")},
    **{name: settings.HANDLERS[name] for name in ("GC", "GL", "GS", "Gc")},
    **dict.fromkeys(TARGETS, motion.set_target), **dict.fromkeys(("MS", "MA"), _slew),
    "CM": _sync, **dict.fromkeys(("Mn", "Ms", "Me", "Mw"), _arrow), **dict.fromkeys(("Qn", "Qs", "Qe", "Qw"), _let_go),
    "Q": _stop, "Mg": _pulse, **dict.fromkeys(("TQ", "TS", "TL"), _drive), "ST": _set_drive, "SG": _zone,
    "GG": _tell_zone, **dict.fromkeys(("SL", "SC", "SXT2"), _set_clock), **dict.fromkeys(("St", "Sg"), _site),
    **dict.fromkeys(("Gt", "Gg"), _tell_site), **dict.fromkeys(("GZ", "GA"), _horizon),
}  # fmt: skip


class SimulatedController(Controller):
    """An OnStepX or TeenAstro with its serial port."""

    def takes(self, frame: bytes) -> bool:
        """Whether a TeenAstro accepts a target that is written so: in high precision only with seconds."""
        seconds = len(SEPARATORS.findall(frame[3:])) > 1
        return frame[3:4] == b"L" or (seconds if self.high else not seconds or frame[2:3] in b"az")

    def answer(self, frame: bytes, send_later: Later | None) -> bytes:
        if frame == ACK:
            return b"P" if self.onstep else b"G"
        word = frame[1:-1].decode("latin-1")
        assert self.protocol.other is not None
        if (fixed := self.protocol.other.facts["simulated"].get(word)) is not None:
            return str(fixed).encode()
        if (answer := WORDS.get(word)) is not None and word not in (OF_TEENASTRO if self.onstep else OF_ONSTEP):
            return answer(self)
        match = self.protocol.find(frame)
        handler = HANDLERS.get(match[0].name) if match is not None else None
        if match is None or handler is None:
            return b"0" if self.onstep else b"#" if word[:1] == "G" else b""
        if not self.onstep and match[0].name in TARGETS and not self.takes(frame):
            return b"0"
        try:
            values = match[1].decode(frame)
        except ValueError:
            return self._no(match[0])
        return handler(self, match[0].name, values) or b""
