"""The simulated OnStepX and TeenAstro, German mounts: their answers that differ from a Meade's.

They begin at the pole with the counterweight down. If they are made not ``aligned``, as after power-on, they are at
home and do not track, an OnStep waits for date and time, and a TeenAstro has no park position. A frame is everything
between a colon and a hash; ACK counts only outside a frame. An OnStep answers 0 to every command that it lacks.
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
from gateway.protocols.mechanics.simulated import SendLater, TimedFramer
from gateway.protocols.wireformat import sexagesimal

ACK, HASH = b"\x06", ord("#")
IGNORED = b" \r\n\x06"
HOME_AXES: Pair = (90.0, 90.0)
#: Seconds until an OnStep ends an arrow's motion; multiples of sidereal: its rates R0 to R7, a TeenAstro's R0 to R3.
ARROW_TIMEOUT = 10.0
ONSTEP_RATES, TEEN_RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 48.0), (0.5, 4.0, 16.0, 64.0)
#: The indices in these tuples of the rates that are selected by a letter.
ONSTEP_RATE_BY_LETTER, TEEN_RATE_BY_LETTER = {"G": 2, "C": 5, "M": 6, "F": 7, "S": 8}, {"G": 0, "C": 1, "M": 2, "S": 3}


class FrameCutter:
    """Cuts frames as these controllers do. An OnStep (``accepts_any_first``) takes any first byte for a colon, and
    shortens a frame that is too long; a TeenAstro drops both kinds of frame.
    """

    def __init__(self, max_length: int, accepts_any_first: bool) -> None:
        self._max_length, self._accepts_any_first, self._frame = max_length, accepts_any_first, bytearray()

    def feed(self, data: bytes, now: float) -> list[bytes]:
        frames = []
        for byte in data:
            if byte == ACK[0] and not self._frame:
                frames.append(ACK)
            elif byte not in IGNORED:
                self._frame = self._frame[: self._max_length - 1] + bytes((byte,))
            if byte == HASH:
                first = self._frame[:1]
                if first == b":":
                    whole = len(self._frame) > 2 and (self._accepts_any_first or len(self._frame) < self._max_length)
                else:
                    whole = self._accepts_any_first and first != b"#"
                if whole:
                    frames.append(bytes(self._frame))
                self._frame.clear()
        return frames


class ControllerMotion(SimulatedLx200):
    """The state of an OnStepX or TeenAstro, by its model, and its motions."""

    @property
    def onstep(self) -> bool:
        return self.model == "onstep"

    @property
    def is_before_onstepx(self) -> bool:
        """Whether it is an OnStep before OnStepX."""
        return str(self.facts["firmware"])[:2] in ("2.", "3.", "4.")

    def power_on(self) -> None:
        super().power_on()
        self.high_precision, self.degree, self.tolerant = True, b"*", True
        self.park_position: Pair | None = HOME_AXES if self.onstep or self.aligned else None
        self.awaited: set[str] = {"SL", "SC"} if self.onstep and not self.aligned else set()  # before it may move
        self.parking = self.homing = False
        self.at_home = not self.aligned
        self.rate_number, self.pulse_rate_number = (6, 2) if self.onstep else (3, 0)
        self.has_pulse_rate = True
        self.ends: dict[int, float] = {}  # axis -> when its arrow ends by itself
        self.error = 0
        self.stored_values.update(lowest=-10.0, highest=90.0)

    def new_framer(self) -> TimedFramer:  # type: ignore[override]
        return FrameCutter(79 if self.onstep else 28, self.onstep)

    def sidereal_multiple(self, number: int) -> float:
        """Return the speed of a rate number (R0 to R9) in multiples of the sidereal rate."""
        rates, fastest = ONSTEP_RATES if self.onstep else TEEN_RATES, self.mechanics.max_rate / SIDEREAL_RATE
        return rates[number] if number < len(rates) else fastest / 2 if self.onstep and number == 8 else fastest

    def advance_to_now(self) -> None:
        now = self.clock()
        for axis, ends in sorted(self.ends.items(), key=lambda item: item[1]):
            if ends <= now:
                self.release_arrows(ends, axis)
        super().advance_to_now()
        if (self.parking or self.homing) and not self.mechanics.slewing(self.now):
            self.parked, self.at_home = self.parking, self.homing
            self.parking = self.homing = False

    def release_arrows(self, now: float, *axes: int) -> None:
        for axis in axes:
            if self.ends.pop(axis, None) is not None:
                self.mechanics.move(now, axis, 0.0)
        if not self.ends and axes:
            self.mechanics.resume_tracking(now)

    # --- what it does ---------------------------------------------------------------------------------------------

    def select_rate(self, letter: str) -> bytes:
        """:R0 to :R9, :RG :RC :RM :RF :RS - select the rate of motion by hand."""
        names = ONSTEP_RATE_BY_LETTER if self.onstep else TEEN_RATE_BY_LETTER
        self.rate_number = names[letter] if letter in names else int(letter)
        if self.rate_number <= 2 and self.onstep and self.has_pulse_rate:
            self.pulse_rate_number = self.rate_number
        return b""

    def switch_tracking(self, on: bool) -> bytes:
        """:Te :Td - turn tracking on or off."""
        if self.parked or self.awaited or (not on and self.onstep and (self.mechanics.slewing(self.now) or self.ends)):
            return b"0"
        self.at_home = self.at_home and not on
        self.track(on)
        return b"1"

    def goto_refusal(self, altitude: float) -> bytes | None:
        """Return the reply that refuses a goto to this altitude, degrees; None if it is allowed."""
        reasons = {
            b"3": bool(self.awaited),
            b"4": self.parked,
            b"5": self.mechanics.slewing(self.now),
            b"8" if self.onstep else b"7": bool(self.ends),
            b"1": altitude < self.stored_values["lowest"],
            b"2" if self.onstep else b"8 ": altitude > self.stored_values["highest"],
        }
        return next((digit.strip() for digit, holds in reasons.items() if holds), None)

    def begin_goto(self, ra: float, dec: float, altitude: float) -> bytes:
        if (refusal := self.goto_refusal(altitude)) is not None:
            return refusal
        self.at_home = False
        self.mechanics.goto_sky(self.now, ra, dec)
        self.track(True)
        return b"0"

    def go_to_park_or_home(self, goal: Pair | None, to_park: bool) -> bytes:
        """Go to the park or home position with tracking off; reply 0 if that is impossible now, else 1."""
        if goal is None or self.parked or self.awaited or self.mechanics.slewing(self.now) or self.ends:
            return b"0"
        self.track(False)
        self.parking, self.homing = to_park, not to_park
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
        self.mechanics.correct(self.now, (wrap180(HOME_AXES[0] - position[0]), wrap180(HOME_AXES[1] - position[1])))
        self.track(False)
        self.at_home = True
        return b"" if self.onstep else b"1"

    @property
    def is_tube_west(self) -> bool:
        """Whether the tube is on the west side of the pier."""
        return self.mechanics.flipped is (self.mechanics.geometry.pole_sign > 0)

    def status_letters(self) -> bytes:
        """:GU - the state in letters."""
        flags = {
            "n": not self.mechanics.tracking(self.now) and not self.mechanics.slewing(self.now),
            "N": not self.mechanics.slewing(self.now),
            "p": not (self.parked or self.parking), "I": self.parking, "P": self.parked, "H": self.at_home,
            "h": self.homing, "G": any(self.mechanics.pulsing(self.now, axis) for axis in (1, 2)), "g": bool(self.ends),
            "(": self.stored_values.get("hertz") == 57.9, "O": self.stored_values.get("hertz") == 60.0, "E": True,
            "o": self.at_home, "W": not self.at_home and self.is_tube_west,
            "T": not self.at_home and not self.is_tube_west,
        }  # fmt: skip
        letters = "".join(letter for letter, holds in flags.items() if holds)
        return f"{letters}{self.pulse_rate_number}{self.rate_number}{self.error}#".encode()

    def status_reply(self) -> bytes:
        """:GW - mounting, tracking and alignment."""
        place = "H" if self.at_home else "P" if self.parked else "1"
        tracks = self.mechanics.tracking(self.now) or (self.mechanics.slewing(self.now) and not self.parking)
        return f"G{'T' if tracks else 'N'}{place}#".encode()

    def pier_side_reply(self) -> bytes:
        """:Gm - the pier side; a TeenAstro sends two hashes."""
        letter = "W" if self.is_tube_west else "E"
        return f"{letter}#".encode() if self.onstep else f"{letter}##".encode()

    def drive_rate_reply(self) -> bytes:
        """:GT - the tracking rate, hertz."""
        if not self.mechanics.tracking(self.now):
            return b"0#" if self.onstep else b"0.00000#"
        return f"{self.stored_values.get('hertz', 60.16427):.5f}#".encode()


# --- the commands that a Meade does not have, or answers otherwise ----------------------------------------------------


def _slew(sim: ControllerMotion, command: str, _: Values) -> bytes:
    ra, dec = sim.stored_values.get("ra", 0.0), sim.stored_values.get("dec", 0.0)
    if command == "MA":
        ra, dec = motion.target_from_horizontal(sim)
    return sim.begin_goto(ra, dec, motion.altitude(sim, ra, dec))


def _sync(sim: ControllerMotion, _: str, __: Values) -> bytes:
    if (refusal := sim.goto_refusal(0.0)) is not None:
        return b"E" + refusal + b"#" if sim.onstep else b""
    motion.sync(sim, "CM", {})
    sim.at_home = False
    return b"N/A#"


def _press_arrow(sim: ControllerMotion, command: str, _: Values) -> None:
    axis, sense = motion.axis_and_sense(sim, command[1])
    if sim.parked or sim.awaited:
        return
    if sim.mechanics.slewing(sim.now):
        sim.mechanics.stop_goto(sim.now)
        return
    if sim.stored_values.get(f"arrow {axis}") == command and axis in sim.ends:
        return
    sim.at_home, sim.stored_values[f"arrow {axis}"] = False, command
    sim.ends[axis] = sim.now + ARROW_TIMEOUT if sim.onstep else math.inf
    sim.mechanics.move(sim.now, axis, sense * sim.sidereal_multiple(sim.rate_number) * SIDEREAL_RATE, additive=True)


def _release_arrow(sim: ControllerMotion, command: str, _: Values) -> None:
    sim.release_arrows(sim.now, motion.axis_and_sense(sim, command[1])[0])


def _stop(sim: ControllerMotion, _: str, __: Values) -> None:
    sim.release_arrows(sim.now, *sim.ends)
    sim.mechanics.stop_goto(sim.now)
    sim.parking = sim.homing = False


def _pulse(sim: ControllerMotion, _: str, values: Values) -> None:
    if sim.parked or sim.awaited or sim.mechanics.slewing(sim.now):
        return
    axis, sense = motion.axis_and_sense(sim, values["direction"])
    rate = sim.pulse_rate_number if sim.has_pulse_rate else sim.rate_number
    sim.mechanics.pulse(sim.now, axis, sense * sim.sidereal_multiple(rate) * SIDEREAL_RATE, values["ms"] / 1000.0)


def _select_drive_rate(sim: ControllerMotion, command: str, _: Values) -> None:
    tracking.select_drive_rate(sim, command, _)
    sim.stored_values["hertz"] = {"TQ": 60.16427, "TS": 60.0, "TL": 57.9}[command]


def _set_drive_hertz(sim: ControllerMotion, _: str, values: Values) -> bytes:
    if not 30.0 <= values["hertz"] < 90.0:
        return b"0"
    sim.stored_values["hertz"] = values["hertz"]
    sim.mechanics.set_drive_rate(sim.now, values["hertz"] / 60.16427 * SIDEREAL_RATE)
    return sim.switch_tracking(True) if sim.onstep else b"1"


def _set_zone(sim: ControllerMotion, _: str, values: Values) -> bytes:
    """:SG - set the zone; UTC stays. An OnStep takes only whole, half and three-quarter hours."""
    offset = values["offset"]
    if not -14.0 < offset <= 12.0 or (sim.onstep and round(offset % 1 * 60) not in (0, 30, 45)):
        return b"0"
    if not sim.onstep and offset < -12.0:
        return b"0"
    sim.utc_offset = -offset
    return b"1"


def _zone_reply(sim: ControllerMotion, _: str, __: Values) -> bytes:
    hours, minutes = divmod(round(abs(sim.utc_offset) * 60), 60)
    sign = "-" if sim.utc_offset > 0 else "+"
    return (f"{sign}{hours:02d}:{minutes:02d}#" if sim.onstep else f"{-sim.utc_offset:+05.1f}#").encode()


def _set_clock(sim: ControllerMotion, command: str, values: Values) -> bytes:
    sim.awaited.discard(command)
    if not sim.awaited and sim.onstep:
        sim.aligned = True
    if command == "SXT2":
        sim.clock_ahead = values["unix"] - sim.now
        sim.relocate()
    elif command == "SC" and not sim.onstep:
        sim.clock_ahead += (values["date"] - datetime.fromtimestamp(sim.utc(), UTC).date()) / timedelta(seconds=1)
        sim.relocate()
    else:
        settings.HANDLERS[command](sim, command, values)
    return b"1"


def _set_site(sim: ControllerMotion, command: str, values: Values) -> bytes:
    if not (sim.onstep or sim.at_home or sim.parked):
        return b"0"
    settings.set_site_coordinate(sim, command, values)
    return b"1"


def _site_reply(sim: ControllerMotion, command: str, _: Values) -> bytes:
    return answers.encode(sim, command, latitude=sim.site[0], longitude=wrap180(-sim.site[1]))


def _az_alt_reply(sim: ControllerMotion, command: str, _: Values) -> bytes:
    return answers.az_alt_reply(sim, command, _).replace(b":", b"'")


def _high_precision_reply(sim: ControllerMotion, command: str) -> bytes:
    """:GRa :GDe :GRL :GDL - in high precision at all times. :GtH :GgH - with seconds and their thousandths."""
    if (template := sim.protocol.commands[command[:2]].reply_form("fine")) is not None and command[1] in "RD":
        return template.encode(dict(zip(("ra", "dec"), sim.position(), strict=True)))
    text = sexagesimal.signed(sim.site[0]) if command == "GtH" else "+" + sexagesimal.azimuth(-sim.site[1] % 360.0)
    return text.encode() + b".000#"


def _toggle_precision(sim: ControllerMotion) -> bytes:
    """:U - toggle the precision; an OnStepX lacks the command."""
    if sim.onstep and not sim.is_before_onstepx:
        return b"0"
    sim.high_precision = not sim.high_precision
    return b""


def _set_park(sim: ControllerMotion) -> bytes:
    sim.park_position = sim.mechanics.axes(sim.now)
    return b"1"


#: Commands of the next table that only an OnStep has, and that only a TeenAstro has.
ONSTEP_ONLY = {"GU", "GX90", "GX97", "GtH", "GgH", "GRa", "GDe"}
TEENASTRO_ONLY = {"GXT2", "GXRX", "GRL", "GDL"}
#: Commands without an argument that a Meade does not have or answers otherwise.
REPLIES: dict[str, Callable[[ControllerMotion], bytes]] = {
    "GU": ControllerMotion.status_letters, "GW": ControllerMotion.status_reply, "Gm": ControllerMotion.pier_side_reply,
    "GT": ControllerMotion.drive_rate_reply, "Te": lambda sim: sim.switch_tracking(True),
    "Td": lambda sim: sim.switch_tracking(False), "U": _toggle_precision, "hQ": _set_park,
    "hP": lambda sim: sim.go_to_park_or_home(sim.park_position, True), "hR": ControllerMotion.unpark,
    "hC": lambda sim: b"" if sim.go_to_park_or_home(HOME_AXES, False) and sim.onstep else b"1",
    "hF": ControllerMotion.declare_home, "GXT2": lambda sim: f"{sim.utc():.0f}#".encode(),
    "GXRX": lambda sim: f"{sim.sidereal_multiple(4):.0f}#".encode(),
    "GX97": lambda sim: f"{sim.mechanics.max_rate:.1f}#".encode(),
    "GX90": lambda sim: f"{sim.sidereal_multiple(sim.pulse_rate_number):.2f}#".encode(),
    **{name: partial(_high_precision_reply, command=name) for name in ("GtH", "GgH", "GRa", "GDe", "GRL", "GDL")},
    "Gh": lambda sim: f"{sim.stored_values['lowest']:+03.0f}*#".encode(),
    "Go": lambda sim: f"{sim.stored_values['highest']:02.0f}*#".encode(),
    **{f"R{letter}": partial(ControllerMotion.select_rate, letter=letter) for letter in "GCMFS0123456789"},
}  # fmt: skip
TARGET_COMMANDS, SEPARATORS = ("Sr", "Sd", "Sa", "Sz"), re.compile(rb"[*:'\xdf]")
HANDLERS: dict[str, Callable[[ControllerMotion, str, Values], bytes | None]] = {
    **{name: answers.HANDLERS[name] for name in ("D", "GD", "GR", "Gd", "Gr", "GVD", "GVN", "GVP", "GVT")},
    **{name: settings.HANDLERS[name] for name in ("GC", "GL", "GS", "Gc")},
    **dict.fromkeys(TARGET_COMMANDS, motion.set_target), **dict.fromkeys(("MS", "MA"), _slew),
    "CM": _sync, **dict.fromkeys(("Mn", "Ms", "Me", "Mw"), _press_arrow),
    **dict.fromkeys(("Qn", "Qs", "Qe", "Qw"), _release_arrow), "Q": _stop, "Mg": _pulse,
    **dict.fromkeys(("TQ", "TS", "TL"), _select_drive_rate), "ST": _set_drive_hertz, "SG": _set_zone, "GG": _zone_reply,
    **dict.fromkeys(("SL", "SC", "SXT2"), _set_clock), **dict.fromkeys(("St", "Sg"), _set_site),
    **dict.fromkeys(("Gt", "Gg"), _site_reply), **dict.fromkeys(("GZ", "GA"), _az_alt_reply),
}  # fmt: skip


class SimulatedController(ControllerMotion):
    """An OnStepX or TeenAstro with its serial port."""

    def accepts_target(self, frame: bytes) -> bool:
        """Whether a TeenAstro accepts this notation: with seconds in high precision, without in low (:Sa :Sz: any)."""
        seconds = len(SEPARATORS.findall(frame[3:])) > 1
        return frame[3:4] == b"L" or (seconds if self.high_precision else not seconds or frame[2:3] in b"az")

    def answer(self, frame: bytes, send_later: SendLater | None) -> bytes:
        if frame == ACK:
            return b"P" if self.onstep else b"G"
        word = frame[1:-1].decode("latin-1")
        assert self.protocol.dialect_rows is not None
        if (fixed := self.protocol.dialect_rows.facts["simulated"].get(word)) is not None:
            return str(fixed).encode()
        if (answer := REPLIES.get(word)) is not None and word not in (TEENASTRO_ONLY if self.onstep else ONSTEP_ONLY):
            return answer(self)
        match = self.protocol.find(frame)
        handler = HANDLERS.get(match[0].name) if match is not None else None
        if match is None or handler is None:
            return b"0" if self.onstep else b"#" if word[:1] == "G" else b""
        if not self.onstep and match[0].name in TARGET_COMMANDS and not self.accepts_target(frame):
            return b"0"
        try:
            values = match[1].decode(frame)
        except ValueError:
            return self._deny(match[0])
        return handler(self, match[0].name, values) or b""
