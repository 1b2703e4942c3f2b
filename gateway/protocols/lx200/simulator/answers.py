"""What a simulated Meade reports: positions, names, modes, bars, menus, help.

Reply forms are from ``commands.toml``; ``encode`` and some handlers change what real telescopes write differently.
"""

from __future__ import annotations

from gateway.astro.axes import Build
from gateway.astro.spherical import hour_angle_to_horizon, wrap180
from gateway.core.operations import Place, Values
from gateway.protocols.lx200.nmea import format_rmc
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope

BAR_COLUMNS = 16
_MODE_BY_DIGIT = {"0": "ALTAZ", "1": "POLAR", "2": "LAND"}
_NAME_KEYS = {"GVP": "product", "GVN": "firmware", "GVD": "firmware_date", "GVT": "firmware_time", "GVF": "full_name"}
_HELP_LINES = ("LX200 help", "Use the arrow keys to move.", "MODE shows the next menu.", "GO TO slews to the object.")
#: The tracking rate that an LX200GPS reports before any rate was set.
_POWER_ON_HERTZ = {"lx200gps": 60.0}


def encode(sim: MeadeTelescope, command: str, **values: object) -> bytes:
    """Return the reply of a command in the current format, with the degree sign that this telescope sends."""
    template = sim.protocol.commands[command].reply_form("high" if sim.high_precision else "low", sim.model)
    return b"" if template is None else template.encode(values).replace(b"*", sim.degree)


def ra_dec_reply(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GR :GD - right ascension and declination."""
    ra, dec = sim.position()
    return encode(sim, command, ra=ra, dec=dec)


def az_alt_reply(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GZ :GA - azimuth and altitude; a classic writes an apostrophe before the seconds of the azimuth."""
    ra, dec = sim.position()
    az, alt = hour_angle_to_horizon(wrap180(sim.mechanics.sky.lst(sim.now) - ra), dec, sim.site[0])
    reply = encode(sim, command, az=az, alt=alt)
    return reply.replace(b":", b"'") if command == "GZ" and sim.classic else reply


def bars_reply(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:D - a bar until a slew ends; on a classic 16 columns for each axis, with bars for the remaining distance."""
    going = sim.mechanics.slewing(sim.now)
    if not sim.classic:
        return b"\x7f#" if going else b"#"
    if not going:
        return b" " * 2 * BAR_COLUMNS + b"#"
    goal, is_axes = sim.goal
    position = sim.mechanics.axes(sim.now) if is_axes else sim.position()
    return b"".join([_distance_bar(wrap180(to - at)) for at, to in zip(position, goal, strict=True)]) + b"#"


def _distance_bar(degrees: float) -> bytes:
    return (b"\xff" * max(1, min(BAR_COLUMNS, round(abs(degrees) / 180.0 * BAR_COLUMNS)))).ljust(BAR_COLUMNS)


def status(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GW - mount type, tracking, alignment: three characters without a #."""
    polar = sim.mechanics.build is Build.WEDGE and not (sim.mode_letter == "L" and sim.land_tells_altaz)
    build = "G" if sim.mechanics.build is Build.GERMAN else "P" if polar else "A"
    tracks = sim.mechanics.tracking(sim.now) or sim.mechanics.slewing(sim.now)
    return f"{build}{'T' if tracks else 'N'}{'P' if sim.parked else int(sim.aligned)}".encode()


def hertz(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GT - the tracking rate in hertz; an LX200GPS writes a sign."""
    rate = sim.stored_values.get("hertz", _POWER_ON_HERTZ.get(sim.model, 60.1))
    return (f"{rate:+05.1f}#" if sim.model == "lx200gps" else f"{rate:04.1f}#").encode()


def menu(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:G0 :G1 :G2 - a line of the mode menu: 16 columns on a classic, empty on other models."""
    if not sim.classic:
        return b"#"
    word = _MODE_BY_DIGIT[command[1]]
    return f"{'>' if word[0] == sim.mode_letter else ' '}{word:<15}#".encode()


def help_text(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:?? :?+ :?- - one line of the help text."""
    step = {"??": -len(_HELP_LINES), "?+": 1, "?-": -1}[command]
    sim.stored_values["help"] = max(0, min(len(_HELP_LINES) - 1, sim.stored_values.get("help", 0) + step))
    return _HELP_LINES[sim.stored_values["help"]].encode() + b"#"


#: Commands that are accepted without a reply or a visible effect.
_SILENT = ("ED", "EK", "ES", "EQ", "GH", "SH")
HANDLERS: dict[str, Handler] = {
    "GR": ra_dec_reply, "GD": ra_dec_reply, "GZ": az_alt_reply, "GA": az_alt_reply, "D": bars_reply,
    "Gr": lambda sim, name, _: encode(sim, name, ra=sim.stored_values.get("ra", 0.0)),
    "Gd": lambda sim, name, _: encode(sim, name, dec=sim.stored_values.get("dec", 0.0)),
    "ACK": lambda sim, name, _: sim.mode_letter.encode(), "GW": status, "GT": hertz, "G0": menu, "G1": menu, "G2": menu,
    **dict.fromkeys(_NAME_KEYS, lambda sim, name, _: f"{sim.facts[_NAME_KEYS[name]]}#".encode()),
    "h?": lambda sim, name, _: b"2" if sim.seeks_home else str(sim.home_state).encode(),
    "gps": lambda sim, name, _: format_rmc(Place(*sim.site), sim.now).encode() + b"#",
    "??": help_text, "?+": help_text, "?-": help_text, **dict.fromkeys(_SILENT, lambda sim, name, _: None),
}  # fmt: skip
