"""What a simulated Meade reports: positions, names, modes, bars, menus, help.

Reply forms are from ``commands.toml``; ``form`` and some handlers change what real telescopes write differently.
"""

from __future__ import annotations

from gateway.astro.axes import Build
from gateway.astro.spherical import hour_angle_to_horizon, wrap180
from gateway.core.operations import Place, Values
from gateway.protocols.lx200.nmea import rmc
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope

BARS = 16
_MENU = {"0": "ALTAZ", "1": "POLAR", "2": "LAND"}
_TEXTS = {"GVP": "product", "GVN": "firmware", "GVD": "firmware_date", "GVT": "firmware_time", "GVF": "full_name"}
_HELP = ("LX200 help", "Use the arrow keys to move.", "MODE shows the next menu.", "GO TO slews to the object.")
#: The tracking rate that an LX200GPS reports before any rate was set.
_POWER_ON_HERTZ = {"lx200gps": 60.0}


def form(sim: MeadeTelescope, name: str, **values: object) -> bytes:
    """Return the reply of a command in the current format, with the degree sign that this telescope sends."""
    template = sim.protocol.commands[name].form("high" if sim.high else "low", sim.model)
    return b"" if template is None else template.encode(values).replace(b"*", sim.degree)


def equatorial(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:GR :GD - right ascension and declination."""
    ra, dec = sim.position()
    return form(sim, name, ra=ra, dec=dec)


def horizon(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:GZ :GA - azimuth and altitude; a classic writes an apostrophe before the seconds of the azimuth."""
    ra, dec = sim.position()
    az, alt = hour_angle_to_horizon(wrap180(sim.mechanics.sky.sidereal(sim.now) - ra), dec, sim.site[0])
    reply = form(sim, name, az=az, alt=alt)
    return reply.replace(b":", b"'") if name == "GZ" and sim.classic else reply


def bars(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:D - a bar until a slew ends; on a classic 16 columns for each axis, with bars for the remaining distance."""
    going = sim.mechanics.slewing(sim.now)
    if not sim.classic:
        return b"\x7f#" if going else b"#"
    if not going:
        return b" " * 2 * BARS + b"#"
    goal, is_axes = sim.goal
    position = sim.mechanics.axes(sim.now) if is_axes else sim.position()
    return b"".join([_bar(wrap180(to - at)) for at, to in zip(position, goal, strict=True)]) + b"#"


def _bar(degrees: float) -> bytes:
    return (b"\xff" * max(1, min(BARS, round(abs(degrees) / 180.0 * BARS)))).ljust(BARS)


def status(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:GW - mount type, tracking, alignment: three characters without a #."""
    polar = sim.mechanics.build is Build.WEDGE and not (sim.letter == "L" and sim.land_tells_altaz)
    build = "G" if sim.mechanics.build is Build.GERMAN else "P" if polar else "A"
    tracks = sim.mechanics.tracking(sim.now) or sim.mechanics.slewing(sim.now)
    return f"{build}{'T' if tracks else 'N'}{'P' if sim.parked else int(sim.aligned)}".encode()


def hertz(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:GT - the tracking rate in hertz; an LX200GPS writes a sign."""
    rate = sim.stored.get("hertz", _POWER_ON_HERTZ.get(sim.model, 60.1))
    return (f"{rate:+05.1f}#" if sim.model == "lx200gps" else f"{rate:04.1f}#").encode()


def menu(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:G0 :G1 :G2 - a line of the mode menu: 16 columns on a classic, empty on other models."""
    if not sim.classic:
        return b"#"
    word = _MENU[name[1]]
    return f"{'>' if word[0] == sim.letter else ' '}{word:<15}#".encode()


def help_text(sim: MeadeTelescope, name: str, _: Values) -> bytes:
    """:?? :?+ :?- - one line of the help text."""
    step = {"??": -len(_HELP), "?+": 1, "?-": -1}[name]
    sim.stored["help"] = max(0, min(len(_HELP) - 1, sim.stored.get("help", 0) + step))
    return _HELP[sim.stored["help"]].encode() + b"#"


#: Commands that are accepted without a reply or a visible effect.
_SILENT = ("ED", "EK", "ES", "EQ", "GH", "SH")
HANDLERS: dict[str, Handler] = {
    "GR": equatorial, "GD": equatorial, "GZ": horizon, "GA": horizon, "D": bars,
    "Gr": lambda sim, name, _: form(sim, name, ra=sim.stored.get("ra", 0.0)),
    "Gd": lambda sim, name, _: form(sim, name, dec=sim.stored.get("dec", 0.0)),
    "ACK": lambda sim, name, _: sim.letter.encode(), "GW": status, "GT": hertz, "G0": menu, "G1": menu, "G2": menu,
    **dict.fromkeys(_TEXTS, lambda sim, name, _: f"{sim.row[_TEXTS[name]]}#".encode()),
    "h?": lambda sim, name, _: b"2" if sim.seeking else str(sim.home).encode(),
    "gps": lambda sim, name, _: rmc(Place(*sim.site), sim.now).encode() + b"#",
    "??": help_text, "?+": help_text, "?-": help_text, **dict.fromkeys(_SILENT, lambda sim, name, _: None),
}  # fmt: skip
