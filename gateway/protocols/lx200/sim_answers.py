"""What a simulated Meade tells: positions, names, modes, bars, menus, help, the objects it knows.

Standard forms come from ``commands.toml``; what real telescopes do otherwise is in ``_degree`` and in few lines here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gateway.protocols.lx200.nmea import rmc
from gateway.sky import Sky
from gateway.spherical import hour_angle_to_horizon, separation, wrap180

if TYPE_CHECKING:
    from gateway.protocols.lx200.simulator import Meade

Values = dict[str, Any]

BARS = 16
_MENU = {"0": "ALTAZ", "1": "POLAR", "2": "LAND"}
_TEXTS = {"GVP": "product", "GVN": "firmware", "GVD": "firmware_date", "GVT": "firmware_time", "GVF": "full_name"}
_HELP = ("LX200 help", "Use the arrow keys to move.", "MODE shows the next menu.", "GO TO slews to the object.")
#: A few objects by hand, J2000: enough for a telescope that is not there.
_MESSIER = {1: (83.633, 22.015), 13: (250.423, 36.461), 31: (10.685, 41.269), 42: (83.822, -5.391),
            45: (56.75, 24.117), 57: (283.396, 33.029)}
_SKY = Sky()


def form(sim: Meade, name: str, **values: Any) -> bytes:
    """The reply of a command in the format that is set, with the degree byte of real hardware."""
    wanted = "high" if sim.high else "low"
    for reply, picture in sim.protocol.commands[name].replies:
        if reply.fault is None and reply.when in (None, wanted, sim.model):
            return picture.encode(values).replace(b"*", b"\xdf")
    return b""


def equatorial(sim: Meade, name: str, _: Values) -> bytes:
    """:GR :GD"""
    ra, dec = sim.position()
    return form(sim, name, ra=ra, dec=dec)


def horizon(sim: Meade, name: str, _: Values) -> bytes:
    """:GZ :GA - the classic's long azimuth has an apostrophe before the seconds."""
    ra, dec = sim.position()
    az, alt = hour_angle_to_horizon(wrap180(sim.mechanics.sky.sidereal(sim.now) - ra), dec, sim.site[0])
    reply = form(sim, name, az=az, alt=alt)
    return reply.replace(b":", b"'") if name == "GZ" and sim.classic else reply


def target(sim: Meade, name: str, _: Values) -> bytes:
    """:Gr :Gd - zero after power-on."""
    return form(sim, name, ra=sim.kept.get("ra", 0.0), dec=sim.kept.get("dec", 0.0))


def bars(sim: Meade, name: str, _: Values) -> bytes:
    """:D - 32 columns on a classic, as many bars as there is way to go; one bar elsewhere."""
    going = sim.mechanics.slewing(sim.now)
    if not sim.classic:
        return b"\x7f#" if going else b"#"
    if not going:
        return b" " * 2 * BARS + b"#"
    way = separation(*sim.position(), sim.kept.get("ra", 0.0), sim.kept.get("dec", 0.0))
    count = max(1, min(BARS, round(way / 180.0 * BARS)))
    return (b"\xff" * count).ljust(BARS) * 2 + b"#"


def letter(sim: Meade, name: str, _: Values) -> bytes:
    """ACK"""
    return sim.letter.encode()


def status(sim: Meade, name: str, _: Values) -> bytes:
    """:GW - three characters, no #."""
    build = "P" if sim.letter == "P" else "A"
    tracks = sim.mechanics.tracking(sim.now) or sim.mechanics.slewing(sim.now)
    return f"{build}{'T' if tracks else 'N'}{'P' if sim.parked else int(sim.aligned)}".encode()


def text(sim: Meade, name: str, _: Values) -> bytes:
    """:GVP :GVN :GVD :GVT :GVF"""
    return f"{sim.row[_TEXTS[name]]}#".encode()


def hertz(sim: Meade, name: str, _: Values) -> bytes:
    """:GT - the LX200GPS writes a sign."""
    rate = sim.kept.get("hertz", 60.1)
    return (f"{rate:+05.1f}#" if sim.model == "lx200gps" else f"{rate:04.1f}#").encode()


def menu(sim: Meade, name: str, _: Values) -> bytes:
    """:G0 :G1 :G2 - 16 columns on a classic, nothing elsewhere."""
    if not sim.classic:
        return b"#"
    word = _MENU[name[1]]
    return f"{'>' if word[0] == sim.letter else ' '}{word:<15}#".encode()


def home(sim: Meade, name: str, _: Values) -> bytes:
    """:h?"""
    if sim.now < sim.busy_until:
        return b"2"
    return str(sim.home).encode()


def gps(sim: Meade, name: str, _: Values) -> bytes:
    """:gps"""
    return rmc(*sim.site, sim.now).encode() + b"#"


def temperature(sim: Meade, name: str, _: Values) -> bytes:
    """:fT"""
    return form(sim, name, value=12.5)


def help_text(sim: Meade, name: str, _: Values) -> bytes:
    """:?? :?+ :?-"""
    step = {"??": -len(_HELP), "?+": 1, "?-": -1}[name]
    sim.kept["help"] = max(0, min(len(_HELP) - 1, sim.kept.get("help", 0) + step))
    return _HELP[sim.kept["help"]].encode() + b"#"


def catalogue(sim: Meade, name: str, values: Values) -> bytes:
    """:Lo :Ls - 1, available."""
    return b"1"


def choose(sim: Meade, name: str, values: Values) -> None:
    """:LM - a target where the number is known; other catalogues are empty here."""
    place = _MESSIER.get(values["number"]) if name == "LM" else None
    if place is not None:
        sim.kept["ra"], sim.kept["dec"] = _SKY.to_of_date(*place, sim.utc())
        sim.kept["object"] = f"M{values['number']}"


def describe(sim: Meade, name: str, _: Values) -> bytes:
    """:LI, :Lf - static texts but on a classic."""
    if not sim.classic:
        return f"{sim.row['object_text' if name == 'LI' else 'find_text']}#".encode()
    return f"{sim.kept.get('object', 'No object')}#".encode() if name == "LI" else b"0 - Objects found#"


def moon(sim: Meade, name: str, values: Values) -> bytes:
    """:SE :Se - 0 while the Moon is down."""
    ra, dec, _ = _SKY.moon(sim.utc(), *sim.site)
    if hour_angle_to_horizon(wrap180(sim.mechanics.sky.sidereal(sim.now) - ra), dec, sim.site[0])[1] <= 0:
        return b"0"
    sim.kept["ra"], sim.kept["dec"] = ra, dec
    return b"1"


def nothing(sim: Meade, name: str, values: Values) -> None:
    """Understood, without a reply or an effect that could be seen."""


_SILENT = ("B+", "B-", "B", "BD", "f+", "f-", "F+", "F-", "FQ", "FF", "FS", "F", "g+", "g-", "r+", "r-", "$BA", "$BZ",
           "$Q", "$QA+", "$QA-", "$QZ+", "$QZ-", "LB", "LF", "LN", "ED", "EK", "ES", "EQ", "GH", "SH")
HANDLERS: dict[str, Any] = {
    "GR": equatorial, "GD": equatorial, "GZ": horizon, "GA": horizon, "Gr": target, "Gd": target, "D": bars,
    "ACK": letter, "GW": status, "GVP": text, "GVN": text, "GVD": text, "GVT": text, "GVF": text, "GT": hertz,
    "G0": menu, "G1": menu, "G2": menu, "h?": home, "gps": gps, "fT": temperature, "??": help_text, "?+": help_text,
    "?-": help_text, "Lo": catalogue, "Ls": catalogue, "LM": choose, "LC": choose, "LS": choose, "LI": describe,
    "Lf": describe, "SE": moon, "Se": moon, **dict.fromkeys(_SILENT, nothing),
}  # fmt: skip
