"""The simulated OnStepX and TeenAstro, German mounts: what they answer otherwise than a Meade.

They begin at home, at the pole with the counterweight down. As after power-on (not ``aligned``) they do not track, an
OnStep waits in standby for date and time, and a TeenAstro has no park position. A frame is all between a colon and a
hash; ACK counts only outside of one. An OnStep answers 0 to every command that it does not know.
"""

from __future__ import annotations

from gateway.astro.axes import Pair
from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.protocols.lx200.simulator.server import SimulatedLx200
from gateway.protocols.mechanics.simulated import TimedFramer

ACK, HASH = b"\x06", ord("#")
IGNORED = b" \r\n\x06"
HOME: Pair = (90.0, 90.0)
#: Seconds after which an OnStep ends an arrow, as delivered; its rates R0 to R7, and those of a TeenAstro, R0 to R3.
ARROW_ENDS = 10.0
ONSTEP_RATES, TEEN_RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 20.0, 48.0), (0.5, 4.0, 16.0, 64.0)
#: The letters of rates in these lists.
ONSTEP_NAMES, TEEN_NAMES = {"G": 2, "C": 5, "M": 6, "F": 7, "S": 8}, {"G": 0, "C": 1, "M": 2, "S": 3}


class FrameCutter:
    """Cuts frames as they do. An OnStep takes ``any_first`` byte for a colon, and cuts short what is too long; a
    TeenAstro drops that.
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
    """The state of one of the two, by its model, and what it does."""

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
        self.kept.update(lowest=-10.0, highest=90.0)

    def framer(self) -> TimedFramer:  # type: ignore[override]
        return FrameCutter(79 if self.onstep else 28, self.onstep)

    def times(self, number: int) -> float:
        """Return a rate in multiples of the sidereal one."""
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
        """:R0 to :R9, :RG :RC :RM :RF :RS"""
        names = ONSTEP_NAMES if self.onstep else TEEN_NAMES
        self.rate = names[letter] if letter in names else int(letter)
        if self.rate <= 2 and self.onstep and self.separate_pulses:
            self.pulse_rate = self.rate
        return b""

    def switch(self, on: bool) -> bytes:
        """:Te :Td"""
        if self.parked or self.standby or (not on and self.onstep and (self.mechanics.slewing(self.now) or self.ends)):
            return b"0"
        self.at_home = self.at_home and not on
        self.track(on)
        return b"1"

    def refusal(self, height: float) -> bytes | None:
        """Return why a goto to this altitude is refused."""
        reasons = {
            b"3": bool(self.standby),
            b"4": self.parked,
            b"5": self.mechanics.slewing(self.now),
            b"8" if self.onstep else b"7": bool(self.ends),
            b"1": height < self.kept["lowest"],
            b"2" if self.onstep else b"8 ": height > self.kept["highest"],
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
        """Go to the park or home position; tracking is off."""
        if goal is None or self.parked or self.standby or self.mechanics.slewing(self.now) or self.ends:
            return b"0"
        self.track(False)
        self.parking, self.homing = parks, not parks
        self.mechanics.goto_axes(self.now, *goal)
        return b"1"

    def unpark(self) -> bytes:
        """:hR"""
        if self.onstep and not self.parked:
            return b"0"
        if self.parked:
            self.parked = False
            self.track(True)
        return b"1"

    def declare_home(self) -> bytes:
        """:hF - this is home, wherever the tube is."""
        here = self.mechanics.axes(self.now)
        self.mechanics.correct(self.now, (wrap180(HOME[0] - here[0]), wrap180(HOME[1] - here[1])))
        self.track(False)
        self.at_home = True
        return b"" if self.onstep else b"1"

    @property
    def west(self) -> bool:
        """Whether it stands on the west side of the pier."""
        return self.mechanics.flipped is (self.mechanics.geometry.pole > 0)

    def letters(self) -> bytes:
        """:GU"""
        told = {
            "n": not self.mechanics.tracking(self.now) and not self.mechanics.slewing(self.now),
            "N": not self.mechanics.slewing(self.now),
            "p": not (self.parked or self.parking), "I": self.parking, "P": self.parked, "H": self.at_home,
            "h": self.homing, "G": any(self.mechanics.pulsing(self.now, axis) for axis in (1, 2)), "g": bool(self.ends),
            "(": self.kept.get("hertz") == 57.9, "O": self.kept.get("hertz") == 60.0, "E": True,
            "o": self.at_home, "W": not self.at_home and self.west,
            "T": not self.at_home and not self.west,
        }  # fmt: skip
        letters = "".join(letter for letter, holds in told.items() if holds)
        return f"{letters}{self.pulse_rate}{self.rate}{self.error}#".encode()

    def state(self) -> bytes:
        """:GW"""
        place = "H" if self.at_home else "P" if self.parked else "1"
        tracks = self.mechanics.tracking(self.now) or (self.mechanics.slewing(self.now) and not self.parking)
        return f"G{'T' if tracks else 'N'}{place}#".encode()

    def side(self) -> bytes:
        """:Gm - a TeenAstro sends two hashes."""
        letter = "W" if self.west else "E"
        return f"{letter}#".encode() if self.onstep else f"{letter}##".encode()

    def hertz(self) -> bytes:
        """:GT"""
        on = self.mechanics.tracking(self.now)
        return f"{self.kept.get('hertz', 60.16427):.5f}#".encode() if on else b"0#" if self.onstep else b"0.00000#"
