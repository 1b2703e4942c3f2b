"""How a simulated Meade moves: targets, slews and their refusals, arrows, guiding, tracking, park and home."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gateway.mount_geometry import Build
from gateway.spherical import SIDEREAL_RATE, horizon_to_hour_angle, hour_angle_to_horizon, wrap180, wrap360

if TYPE_CHECKING:
    from gateway.protocols.lx200.simulator import Meade

Values = dict[str, Any]

#: :RG and :RC in multiples of the sidereal rate, :RM in degrees a second; :RS is the fastest.
GUIDE, CENTER, FIND = 1.0, 16.0, 2.0
#: Seconds that an LX200GPS is busy with itself for.
ALIGNING, GPS_FIX, SEEKING = 120.0, 60.0, 30.0
_BELOW = {True: b"1Object below    horizon.        #", False: b"1Object Below Horizon.#"}
_ABOVE = {True: b"2Object above    higher limit.  #", False: b"2Object Below Higher.#"}
_DRIVES = {"TQ": 60.1, "TS": 60.0, "TL": 57.9}


def set_target(sim: Meade, name: str, values: Values) -> bytes:
    """:Sr :Sd :Sa :Sz"""
    sim.kept.update(values)
    return b"1"


def _altitude(sim: Meade, ra: float, dec: float) -> float:
    hour_angle = wrap180(sim.mechanics.sky.sidereal(sim.now) - ra)
    return hour_angle_to_horizon(hour_angle, dec, sim.site[0])[1]


def slew(sim: Meade, name: str, _: Values) -> bytes:
    """:MS"""
    ra, dec = sim.kept.get("ra", 0.0), sim.kept.get("dec", 0.0)
    return _slew(sim, ra, dec, _altitude(sim, ra, dec)) or b"0"


def slew_horizontal(sim: Meade, name: str, _: Values) -> bytes:
    """:MA - 1 is a fault."""
    az, alt = sim.kept.get("az", 0.0), sim.kept.get("alt", 0.0)
    hour_angle, dec = horizon_to_hour_angle(az, alt, sim.site[0])
    ra = wrap360(sim.mechanics.sky.sidereal(sim.now) - hour_angle)
    return b"1" if _slew(sim, ra, dec, alt) else b"0"


def _slew(sim: Meade, ra: float, dec: float, altitude: float) -> bytes | None:
    """Begin, or say why not."""
    if altitude < sim.kept["lowest"] - 1e-3:
        return _BELOW[sim.classic]
    if altitude > sim.kept["highest"] + 1e-3:
        return _ABOVE[sim.classic]
    sim.parked = False
    sim.arrows.clear()
    sim.mechanics.goto_sky(sim.now, ra, dec)
    return None


def sync(sim: Meade, name: str, _: Values) -> bytes | None:
    """:CM :CL"""
    sim.mechanics.sync(sim.now, sim.kept.get("ra", 0.0), sim.kept.get("dec", 0.0))
    sim.aligned = True
    return f"{sim.row['sync_text']}#".encode() if name == "CM" else None


def rate(sim: Meade, name: str, _: Values) -> None:
    """:RG :RC :RM :RS"""
    sim.kept["rate"] = name


def key_rate(sim: Meade, name: str, values: Values) -> None:
    """:R<n>"""
    key = values["key"]
    sim.kept["rate"] = "RG" if key <= 2 else "RC" if key <= 5 else "RM" if key <= 7 else "RS"


def free_rate(sim: Meade, name: str, values: Values) -> None:
    """:RA :RE :Rg - degrees a second for :RS, arcseconds a second for :RG."""
    sim.kept[name] = values["rate"]


def max_rate(sim: Meade, name: str, values: Values) -> bytes:
    """:Sw"""
    low, high = sim.row["max_rates"]
    if not low <= values["rate"] <= high:
        return b"0"
    sim.mechanics.fastest = float(values["rate"])
    return b"1"


def _speed(sim: Meade, axis: int) -> float:
    """Degrees a second of the arrows."""
    name = sim.kept["rate"]
    if name == "RG":
        return float(sim.kept.get("Rg", GUIDE * 15.041)) / 3600.0
    if name == "RC":
        return CENTER * SIDEREAL_RATE
    if name == "RM":
        return FIND
    return float(sim.kept.get("RA" if axis == 1 else "RE") or sim.mechanics.fastest)


def _axis(sim: Meade, letter: str) -> tuple[int, float]:
    """The motor and its sense for an arrow: north is up the declination, west the way of the stars."""
    polar, pole = sim.mechanics.build is Build.WEDGE, sim.mechanics.geometry.pole
    if letter in "ns":
        return 2, (1.0 if letter == "n" else -1.0) * (pole if polar else 1)
    return 1, (1.0 if letter == "w" else -1.0) * (pole if polar else 1)


def arrow(sim: Meade, name: str, _: Values) -> None:
    """:Mn :Ms :Me :Mw"""
    axis, sense = _axis(sim, name[1])
    gentle = sim.kept["rate"] == "RG" and sim.mechanics.build is Build.WEDGE
    sim.mechanics.cancel(sim.now)
    sim.mechanics.move(sim.now, axis, sense * _speed(sim, axis), gentle)
    sim.arrows.add(axis)
    sim.parked = False


def let_go(sim: Meade, name: str, _: Values) -> None:
    """:Qn :Qs :Qe :Qw - tracking goes on by itself when the last arrow is released."""
    axis, _sense = _axis(sim, name[1])
    if axis in sim.arrows:
        sim.arrows.discard(axis)
        sim.mechanics.move(sim.now, axis, 0.0)
    if not sim.arrows and not sim.mechanics.slewing(sim.now):
        sim.mechanics.resume(sim.now)


def stop(sim: Meade, name: str, _: Values) -> None:
    """:Q"""
    sim.busy_until = 0.0
    sim.mechanics.cancel(sim.now)
    for axis in list(sim.arrows):
        sim.mechanics.move(sim.now, axis, 0.0)
    sim.arrows.clear()
    sim.mechanics.resume(sim.now)


def pulse(sim: Meade, name: str, values: Values) -> None:
    """:Mg"""
    axis, sense = _axis(sim, values["direction"])
    speed = float(sim.kept.get("Rg", GUIDE * 15.041)) / 3600.0
    sim.mechanics.pulse(sim.now, axis, sense * speed, values["ms"] / 1000.0)


def drive(sim: Meade, name: str, _: Values) -> None:
    """:TQ :TS :TL :TM"""
    sim.kept["manual"] = name == "TM"
    sim.kept["hertz"] = _DRIVES.get(name) or sim.kept.get("custom", 60.1)


def set_drive(sim: Meade, name: str, values: Values) -> bytes:
    """:ST :T - a classic takes 56.4 to 60.1 only, and :ST only in manual mode."""
    hertz = values["hertz"]
    if sim.classic and (not 56.4 <= hertz <= 60.15 or (name == "ST" and not sim.kept.get("manual"))):
        return b"0" if name == "ST" else b""
    sim.kept["custom"] = sim.kept["hertz"] = hertz
    return b"1"


def step_drive(sim: Meade, name: str, _: Values) -> None:
    """:T+ :T-"""
    step = 0.1 if name == "T+" else -0.1
    sim.kept["custom"] = sim.kept["hertz"] = round(sim.kept.get("custom", 60.1) + step, 1)


def align(sim: Meade, name: str, _: Values) -> None:
    """:AA :AP :AL - a mode; where :GW is not known the alignment is gone with it."""
    letter = {"AA": "A", "AP": "P", "AL": "L"}[name]
    if letter != "L":
        sim.mechanics.rebuild(sim.now, Build.WEDGE if letter == "P" else Build.ALTAZ)
    if sim.classic:
        sim.aligned = False
        sim.mechanics.correct(sim.now, (0.0, 0.0))
    sim.letter = letter
    sim.track(letter != "L")


def auto_align(sim: Meade, name: str, _: Values) -> bytes:
    """:Aa - minutes on a real one; here it is done at once and the telescope busy afterwards."""
    if sim.letter != "A":
        return b"0"
    sim.busy_until, sim.aligned = sim.now + ALIGNING, True
    sim.track(True)
    return b"1"


def park(sim: Meade, name: str, _: Values) -> None:
    """:hP - azimuth and altitude zero, or the pole; then tracking is off."""
    sim.track(False)
    sim.mechanics.goto_axes(sim.now, *((sim.mechanics.axes(sim.now)[0], 90.0) if sim.letter == "P" else (0.0, 0.0)))
    sim.parked = True


def seek_home(sim: Meade, name: str, _: Values) -> None:
    """:hS :hF - ignored by an Autostar."""
    if sim.model != "autostar":
        sim.busy_until, sim.home = sim.now + SEEKING, 1


def sleep(sim: Meade, name: str, _: Values) -> None:
    """:hN :hW"""
    sim.track(name == "hW")


def restart(sim: Meade, name: str, _: Values) -> bytes:
    """:I"""
    sim.parked = False
    sim.track(sim.aligned)
    return b"X"


HANDLERS: dict[str, Any] = {
    "Sr": set_target, "Sd": set_target, "Sa": set_target, "Sz": set_target, "MS": slew, "MA": slew_horizontal,
    "CM": sync, "CL": sync, "RG": rate, "RC": rate, "RM": rate, "RS": rate, "R": key_rate, "RA": free_rate,
    "RE": free_rate, "Rg": free_rate, "Sw": max_rate, "Mn": arrow, "Ms": arrow, "Me": arrow, "Mw": arrow,
    "Qn": let_go, "Qs": let_go, "Qe": let_go, "Qw": let_go, "Q": stop, "Mg": pulse, "TQ": drive, "TS": drive,
    "TL": drive, "TM": drive, "ST": set_drive, "T": set_drive, "T+": step_drive, "T-": step_drive, "AA": align,
    "AP": align, "AL": align, "Aa": auto_align, "hP": park, "hS": seek_home, "hF": seek_home, "hN": sleep, "hW": sleep,
    "I": restart,
}  # fmt: skip
