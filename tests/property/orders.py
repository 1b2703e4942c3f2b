"""What the programs and the person of a play do, as bytes of either protocol and as keys of the simulated hand control.

The bytes are typed from the two papers. Angles are degrees; a place is azimuth and altitude over the true horizon.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from msgspec import Struct

from gateway.astro.axes import Build
from gateway.astro.spherical import horizon_to_hour_angle, wrap180, wrap360
from gateway.protocols.lx200.simulator import motion, tracking
from tests.support.typed_programs import nexstar_angle

RATES = ("guide", "center", "find", "max")
_MEADE_RATE = dict(zip(RATES, (b"RG", b"RC", b"RM", b"RS"), strict=True))
_KEY = dict(zip(RATES, (1, 4, 7, 9), strict=True))
_DRIVE = {"sidereal": (b":TQ#", b"\xff\xff"), "solar": (b":TS#", b"\xff\xfe"), "lunar": (b":TL#", b"\xff\xfd")}
#: Motor and sense of an arrow in the north.
_MOTOR = {"n": (17, 36), "s": (17, 37), "w": (16, 36), "e": (16, 37)}


class Event(Struct, frozen=True):
    """``at`` seconds after the beginning; ``who`` is a session (1 to 3), or 0 for the person beside the mount."""

    at: float
    who: int
    what: str
    how: tuple[Any, ...] = ()

    def words(self) -> str:
        return f"{self.at:7.2f} s  {'owner' if self.who == 0 else f'program {self.who}'}  {self.what} {self.how}"


def sky(sim: Any, az: float, alt: float) -> tuple[float, float]:
    """Right ascension and declination of date of a place over the true horizon."""
    ground = sim.mechanics.true_sky
    hour_angle, dec = horizon_to_hour_angle(az, alt, ground.latitude)
    return wrap360(ground.lst(sim.clock()) - hour_angle), dec


# --- programs -----------------------------------------------------------------------------------------------------


def _sexagesimal(value: float, digits: int, signed: bool, mark: bytes = b":") -> bytes:
    seconds = round(abs(value) * 3600.0)
    sign = (b"-" if value < 0 else b"+") if signed else b""
    return sign + b"%0*d%s%02d:%02d" % (digits, seconds // 3600, mark, seconds // 60 % 60, seconds % 60)


def lx200(sim: Any, event: Event) -> bytes:
    """The bytes of a program that speaks LX200."""
    how = event.how
    if event.what in ("goto", "sync"):
        ra, dec = sky(sim, *how) if event.what == "goto" else _shifted(sim, *how)
        end = b":MS#" if event.what == "goto" else b":CM#"
        hours = _sexagesimal(round(ra / 15.0 * 3600.0) % 86400 / 3600.0, 2, False)
        return b":Sr" + hours + b"#:Sd" + _sexagesimal(dec, 2, True, b"*") + b"#" + end
    if event.what == "arrow":
        return b":%s#:M%s#" % (_MEADE_RATE[how[1]], how[0].encode())
    if event.what == "release":
        return b":Q%s#" % how[0].encode()
    if event.what == "stop":
        return b":Q#"
    if event.what == "pulse":
        return b":Mg%s%04d#" % (how[0].encode(), how[1])
    if event.what == "track":
        return (b":AP#" if polar(sim) else b":AA#") if how[0] else b":AL#"
    if event.what == "rate":
        return _DRIVE[how[0]][0]
    if event.what == "park":
        return b":hP#"
    if event.what == "site":
        latitude, longitude = sited(sim, *how)
        west = round(-longitude % 360.0 * 60.0)
        return b":St%s#:Sg%03d*%02d#" % (_sexagesimal(latitude, 2, True, b"*")[:6], west // 60, west % 60)
    if event.what == "clock":
        local = datetime.fromtimestamp(sim.clock() + how[0], UTC)
        return local.strftime(":SG+00#:SL%H:%M:%S#:SC%m/%d/%y#").encode()
    return b""


def nexstar(sim: Any, event: Event) -> bytes:
    """The bytes of a program that speaks to a hand control of version 4.21."""
    how = event.how
    if event.what in ("goto", "sync"):
        ra, dec = sky(sim, *how) if event.what == "goto" else _shifted(sim, *how)
        return b"%s%08X,%08X" % (b"r" if event.what == "goto" else b"s", _turn(ra), _turn(dec))
    if event.what == "arrow":
        return bytes((80, 2, *_MOTOR[how[0]], _KEY[how[1]], 0, 0, 0))
    if event.what == "release":
        return bytes((80, 2, _MOTOR[how[0]][0], 36, 0, 0, 0, 0))
    if event.what == "stop":
        return b"M" + bytes((80, 2, 16, 36, 0, 0, 0, 0, 80, 2, 17, 36, 0, 0, 0, 0))
    if event.what == "pulse":
        motor, sense = _MOTOR[how[0]]
        return bytes((80, 3, motor, 0x26, 50 if sense == 36 else 206, min(255, how[1] // 10), 0, 0))
    if event.what == "track":
        return bytes((84, (2 if polar(sim) else 1) if how[0] else 0))
    if event.what == "rate":
        return bytes((80, 3, 16, 6, *_DRIVE[how[0]][1], 0, 0))
    if event.what == "site":
        latitude, longitude = sited(sim, *how)
        return b"W" + nexstar_angle(latitude) + nexstar_angle(longitude)
    if event.what == "clock":
        local = datetime.fromtimestamp(sim.clock() + how[0], UTC)
        return bytes((72, local.hour, local.minute, local.second, local.month, local.day, local.year - 2000, 0, 0))
    return b""


def _turn(degrees: float) -> int:
    return round(degrees % 360.0 / 360.0 * 2**32) % 2**32 & 0xFFFFFF00


def _shifted(sim: Any, east: float, north: float) -> tuple[float, float]:
    """Where the mount believes to point, and so far from there."""
    ra, dec = sim.mechanics.believed(sim.clock())
    dec = wrap180(dec)
    if abs(dec) > 90.0:
        ra, dec = ra + 180.0, (180.0 if dec > 0 else -180.0) - dec
    return wrap360(ra + east), max(-89.0, min(89.0, dec + north))


def sited(sim: Any, north: float, east: float) -> tuple[float, float]:
    """So far from where the mount really stands, to whole arcminutes."""
    ground = sim.mechanics.true_sky
    return round((ground.latitude + north) * 60.0) / 60.0, round((ground.longitude + east) * 60.0) / 60.0


def polar(sim: Any) -> bool:
    """Whether the mount stands equatorially."""
    return sim.mechanics.build is not Build.ALTAZ


# --- the person beside the mount ----------------------------------------------------------------------------------


class Keypad:
    """The keys of a simulated hand control; what they do is not told to anybody."""

    def __init__(self, sim: Any) -> None:
        self._sim, self._meade = sim, hasattr(sim, "arrows")
        self.pressed: set[str] = set()

    def do(self, event: Event) -> None:
        sim = self._sim
        sim.true_position()
        if event.what == "key":
            self._press(*event.how)
        elif event.what == "unkey":
            self.release()
        elif event.what == "cancel":
            if self._meade:
                motion.stop(sim, "Q", {})
            else:
                sim.mechanics.cancel(sim.now)
        elif event.what == "own track":
            self._track(event.how[0])
        elif event.what == "own site":
            latitude, longitude = sited(sim, *event.how)
            if self._meade:
                sim.sites[sim.site_number] = latitude, longitude
                sim.relocate()
            else:
                sim.relocate(sim.mechanics.sky._replace(latitude=latitude, longitude=longitude))

    def _press(self, letter: str, rate: str) -> None:
        sim = self._sim
        self.pressed.add(letter)
        if self._meade:
            kept, sim.stored_values["rate"] = sim.stored_values["rate"], _MEADE_RATE[rate].decode()
            motion.press_arrow(sim, f"M{letter}", {})
            sim.stored_values["rate"] = kept
            return
        motor, sense = _MOTOR[letter]
        sim.mechanics.stop_goto(sim.now)
        sim.mechanics.move(sim.now, motor - 15, (1 if sense == 36 else -1) * sim.key_speeds[_KEY[rate] - 1])

    def release(self) -> None:
        """Every key is let go; a hand control goes on tracking then."""
        sim = self._sim
        sim.true_position()
        for letter in self.pressed:
            if self._meade:
                motion.release_arrow(sim, f"Q{letter}", {})
            else:
                sim.mechanics.move(sim.now, _MOTOR[letter][0] - 15, 0.0)
        if self.pressed and not self._meade and sim.mode:
            sim.mechanics.resume(sim.now)
        self.pressed.clear()

    def _track(self, on: bool) -> None:
        sim = self._sim
        if self._meade:
            tracking.set_alignment_mode(sim, ("AP" if polar(sim) else "AA") if on else "AL", {})
        else:
            sim.track((2 if polar(sim) else 1) if on else 0)


def set_up(sim: Any, az: float, alt: float) -> None:
    """Point a mount somewhere before a play begins: let a minute pass afterwards."""
    sim.true_position()
    ra, dec = sky(sim, az, alt)
    sim.mechanics.goto_sky(sim.now, ra, dec)
