"""A judge of a gateway at work: looks where the simulated tube really points and at every byte that the mount is sent.

Its astronomy is its own and plain (Astronomical Almanac: the Sun to 0.01 degree, mean sidereal time), so that a mistake
in the gateway's cannot hide. What the mount believes counts as the sky, for a sync may change that. Angles are degrees.
"""

from __future__ import annotations

import re
from math import acos, asin, atan2, cos, degrees, radians, sin
from typing import Any

#: Degrees a second above which it is a motion and neither tracking nor guiding.
MOTION = 0.02
#: Bytes of a request to a hand control, by its opcode.
LENGTHS = {
    **dict.fromkeys("EZezJLMVmtwhvplxyiu", 1),
    **dict.fromkeys("TK", 2),
    **dict.fromkeys("WHIP", 9),
    **dict.fromkeys("RBS", 10),
    **dict.fromkeys("rbs", 18),
    "P": 8,
}
#: Never to any device: firmware upload (RTC setting excepted), memory, an axis's position, finding the index.
FIRMWARE, MEMORY, INDEX, SET_POSITION = range(0x81, 0x85), (0x30, 0x31), 0x19, 0x04
RTC, RTC_DATE, RTC_YEAR = 178, 0x83, 0x84
#: Hand controls before that are moved by small gotos, which are ended on their way: the tube is judged, not the goal.
STEPS_BEFORE = (1, 6)
#: What a coarse request may be off by.
ROUNDING = 0.02


def sidereal(unix: float, longitude: float) -> float:
    return (280.46061837 + 360.98564736629 * (unix / 86400.0 - 10957.5) + longitude) % 360.0


def sun(unix: float) -> tuple[float, float]:
    """Apparent right ascension and declination."""
    days = unix / 86400.0 - 10957.5
    mean, anomaly = 280.460 + 0.9856474 * days, radians(357.528 + 0.9856003 * days)
    longitude = radians(mean + 1.915 * sin(anomaly) + 0.020 * sin(2 * anomaly))
    tilt = radians(23.439 - 0.0000004 * days)
    return (
        degrees(atan2(cos(tilt) * sin(longitude), cos(longitude))) % 360.0,
        degrees(asin(sin(tilt) * sin(longitude))),
    )


def apart(ra: float, dec: float, other_ra: float, other_dec: float) -> float:
    a, b = radians(dec), radians(other_dec)
    return degrees(acos(max(-1.0, min(1.0, sin(a) * sin(b) + cos(a) * cos(b) * cos(radians(ra - other_ra))))))


def folded(ra: float, dec: float) -> tuple[float, float]:
    """A declination beyond the pole as the place it is."""
    dec = (dec + 180.0) % 360.0 - 180.0
    return (ra % 360.0, dec) if abs(dec) <= 90.0 else ((ra + 180.0) % 360.0, (180.0 if dec > 0 else -180.0) - dec)


def turned(pole: float, first: float, second: float) -> tuple[float, float]:
    """(azimuth, altitude) <-> (hour angle, declination) at a latitude; both ways are the same rotation."""
    a, b, c = radians(first), radians(second), radians(pole)
    height = asin(max(-1.0, min(1.0, sin(b) * sin(c) + cos(b) * cos(c) * cos(a))))
    return degrees(atan2(-cos(b) * sin(a), sin(b) * cos(c) - cos(b) * sin(c) * cos(a))) % 360.0, degrees(height)


class Judge:
    """``complaints`` is what was wrong, with the virtual second; ``worst`` the farthest beyond each limit."""

    def __init__(
        self,
        bridge: Any,
        protocol: str,
        lowest: float,
        highest: float,
        circle: float,
        unsettles: re.Pattern[bytes],
        latency: float,
    ) -> None:
        #: Until a client says something that makes the gateway's sky another one than the mount's: no limit after that.
        self.strict, self._unsettles = True, unsettles
        self.bridge, self.sim, self.protocol = bridge, bridge.sim, protocol
        self.lowest, self.highest, self.circle, self.latency = lowest, highest, circle, latency
        self.complaints: list[str] = []
        #: What was not answered, and the reason: so late it would be taken for another's answer.
        self.unanswered: set[str] = set()
        self.worst = {"low": 0.0, "high": 0.0, "sun": 0.0}
        self.looks = 0
        self.began = bridge.clock()
        self.lenient = ""
        self._entered = {"low": 0.0, "high": 0.0, "sun": 0.0}
        self._slewed = self._moves = False
        self._before: tuple[float, tuple[float, float], tuple[float, float]] | None = None
        bridge.wire_log.sinks.append(self._hear)

    def complain(self, text: str) -> None:
        self.complaints.append(f"{self.bridge.clock() - self.began:.1f} s: {text}")

    # --- the sky as the mount believes it --------------------------------------------------------------------------

    @property
    def sky(self) -> Any:
        return self.sim.mechanics.sky

    def unix(self) -> float:
        return float(self.bridge.clock() + self.sky.ahead)

    def altitude(self, ra: float, dec: float) -> float:
        sky = self.sky
        return turned(sky.latitude, sidereal(self.unix(), sky.longitude) - ra, dec)[1]

    def at(self, az: float, alt: float) -> tuple[float, float]:
        """Right ascension and declination of a place over the horizon."""
        sky = self.sky
        hour_angle, dec = turned(sky.latitude, az, alt)
        return (sidereal(self.unix(), sky.longitude) - hour_angle) % 360.0, dec

    def of_axes(self, first: float, second: float) -> tuple[float, float]:
        """Where axis readings point: azimuth and altitude, or from the meridian (a wedge in the north: from north)."""
        build, sky = self.sim.mechanics.build.name, self.sky
        if build == "ALTAZ":
            return self.at(first, second)
        pole = 1.0 if sky.latitude >= 0.0 else -1.0
        hour_angle = pole * (first - (180.0 if build == "WEDGE" and pole > 0.0 else 0.0))
        return folded(sidereal(self.unix(), sky.longitude) - hour_angle, pole * second)

    def from_sun(self, ra: float, dec: float) -> float:
        """Degrees from the Sun while it is up, else 180."""
        here = sun(self.unix())
        return apart(ra, dec, *here) if self.altitude(*here) > -1.0 else 180.0

    def believed(self) -> tuple[float, float]:
        return folded(*self.sim.mechanics.believed(self.bridge.clock()))

    def turned(self, before: tuple[float, float], after: tuple[float, float]) -> float:
        """How far the axis turned that turned most."""
        return max(abs((q - p + 180.0) % 360.0 - 180.0) for p, q in zip(before, after, strict=True))

    # --- looking at the tube ----------------------------------------------------------------------------------------

    def look(self) -> float:
        """Compare with the look before -> how fast the tube moves over the sky, degrees a second."""
        now, mechanics = self.bridge.clock(), self.sim.mechanics
        axes, here = mechanics.axes(now), self.believed()
        before, self._before = self._before, (now, axes, here)
        if before is None or now <= before[0]:
            return 0.0
        self.looks += 1
        elapsed = now - before[0]
        moved = apart(*before[2], *here)
        speed_of_axes = self.turned(before[1], axes) / elapsed
        jumped = moved > 2.0 * speed_of_axes * elapsed + 0.1  # by a sync; a look later it is seen where it leads
        speed = moved / elapsed
        altitude = self.altitude(*here)
        beyond = {
            "low": self.lowest - altitude,
            "high": altitude - self.highest,
            "sun": self.circle - self.from_sun(*here),
        }
        slewing = mechanics.slewing(now)
        self._moves = slewing or speed > MOTION
        self._slewed = self._slewed or slewing
        for limit, amount in beyond.items():
            if amount <= 0.0:
                self._entered[limit] = 0.0
            elif jumped or speed < MOTION or self.lenient or not (self.strict and self.sim.aligned):
                self._entered[limit] = max(self._entered[limit], amount + jumped * speed_of_axes)
            else:
                farther = amount - self._entered[limit]
                self.worst[limit] = max(self.worst[limit], farther)
                if farther > self.tolerance():
                    self._entered[limit] = amount
                    self.complain(
                        f"{limit} limit crossed by {amount:.2f} at {speed:.2f} deg/s "
                        f"({'goto' if self._slewed else 'by hand'})"
                    )
        if speed < MOTION:
            self.lenient, self._slewed = "", slewing
        return speed

    def tolerance(self) -> float:
        """By hand nothing but jitter; on the way of a goto what it goes between two looks and a stop on its line."""
        if self.bridge.clock() < getattr(self.sim, "busy_until", 0.0):
            return 2.5 * float(self.sim.mechanics.fastest)  # an LX200GPS that is busy tells nothing, and moves on
        if self._slewed:
            return float(self.sim.mechanics.fastest) * (0.6 + 4.0 * self.latency)
        return 0.1

    # --- looking at the bytes ---------------------------------------------------------------------------------------

    def _hear(self, entry: Any) -> None:
        if entry.arrow == "!" and "internal error" in entry.note:
            self.complain(entry.note)
        if entry.arrow == "!" and entry.note.startswith("no reply to"):
            self.unanswered.add(entry.note)
        if entry.side != "mount" and entry.arrow == ">" and self._unsettles.match(entry.data):
            self.strict = False
        if entry.side == "mount" and entry.arrow == ">" and entry.data:
            (self._to_hand_control if self.protocol == "nexstar" else self._to_meade)(entry.data)

    def _target(self, words: str, ra: float, dec: float) -> None:
        if not self.strict:
            return
        altitude, distance = self.altitude(ra, dec), self.from_sun(ra, dec)
        if not self.lowest - ROUNDING <= altitude <= self.highest + ROUNDING:
            self.complain(f"{words} to altitude {altitude:.2f}")
        if distance < self.circle - ROUNDING:
            self.complain(f"{words} to {distance:.2f} degrees from the Sun")

    def _sync(self, words: str, ra: float, dec: float) -> None:
        if self.strict and self.sim.aligned and apart(ra, dec, *self.believed()) > self.sync_limit():
            self.complain(f"{words} by {apart(ra, dec, *self.believed()):.1f} degrees")

    def sync_limit(self) -> float:
        """Fifteen degrees, and as far as it goes between the look and the sync."""
        return 15.1 + float(self.sim.mechanics.fastest) * self._moves

    def _to_hand_control(self, data: bytes) -> None:
        opcode = chr(data[0])
        self._slewed = self._slewed or opcode in "RrBb"  # it may be over before the next look
        if len(data) != LENGTHS.get(opcode):
            self.complain(f"to the hand control: {data!r} is no whole command")
        elif opcode in "RrSsBb":
            numbers = data[1:].split(b",")
            first, second = (int(text, 16) / 16 ** len(text) * 360.0 for text in numbers)
            second = (second + 180.0) % 360.0 - 180.0
            if opcode in "Rr" and not self.sim.aligned:
                self.complain(f"{data!r} without an alignment")
            elif opcode in "Rr":
                if not (opcode == "R" and self.sim.version < STEPS_BEFORE):
                    self._target(repr(data), *folded(first, second))
            elif opcode in "Ss":
                self._sync(repr(data), *folded(first, second))
            elif self.sim.aligned:
                self._target(repr(data), *self.of_axes(first, second))
        elif opcode == "P":
            device, number = data[2], data[3]
            upload = number in FIRMWARE and not (device == RTC and number in (RTC_DATE, RTC_YEAR))
            if upload or number in MEMORY or (number == SET_POSITION and device in (16, 17)) or number == INDEX:
                self.complain(f"{data!r} is never to be passed on")
        elif opcode in "WHI" and self.sim.aligned:
            self.complain(f"{data!r} to an aligned hand control")

    def _to_meade(self, data: bytes) -> None:
        kept = self.sim.stored
        self._slewed = self._slewed or data in (b":MS#", b":MA#")
        if data != b"\x06" and not re.fullmatch(rb"(:|\$Q)[^:#]*#|:[^#]*#", data):
            self.complain(f"to the telescope: {data!r} is no whole command")
        elif data in (b":MS#", b":MA#", b":CM#"):
            place = kept.get("ra", 0.0), kept.get("dec", 0.0)
            if data == b":CM#":
                self._sync("sync", *place)
                return
            self._target(repr(data), *(self.at(kept["az"], kept["alt"]) if data == b":MA#" else place))
        elif data in (b":AL#", b":AA#", b":AP#") and self.sim.classic:
            self.complain(f"{data!r} destroys the alignment of a classic")
        elif data in (b":hP#", b":hS#", b":hF#"):
            self.lenient = "park or home"  # its own places; and one that seeks its home tells nothing on the way


class TrueJudge(Judge):
    """Judges by the true site and time and by where the tube is, whatever the sources say that contradict each other.

    Orders are judged by what comes of them, and as far as an alignment and the run-on of motors may be off.
    """

    @property
    def sky(self) -> Any:
        return self.sim.mechanics.true_sky

    def believed(self) -> tuple[float, float]:
        return folded(*self.sim.truth())

    def tolerance(self) -> float:
        return 1.0 + max(super().tolerance(), 0.5 * float(self.sim.mechanics.fastest))

    def _target(self, words: str, ra: float, dec: float) -> None:
        pass

    def _sync(self, words: str, ra: float, dec: float) -> None:
        pass
