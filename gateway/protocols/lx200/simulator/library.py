"""The object library of a simulated Meade: a few objects, and the Moon.

The classics look objects up and step through their list; Autostar and LX200GPS select objects by number only and
answer ``:LI#`` and ``:Lf#`` with the manual's fixed texts. An object that is not found leaves the target unchanged.
"""

from __future__ import annotations

from typing import NamedTuple

from gateway.astro.ephemeris.sky import Sky
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator.motion import altitude
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope


class LibraryObject(NamedTuple):
    """An object of the library; right ascension and declination in degrees, J2000."""

    messier: int
    ngc: int
    kind: str
    ra: float
    dec: float


#: NGC 0 means none: the Pleiades are not in that catalogue.
_OBJECTS = (
    LibraryObject(1, 1952, "SNR", 83.633, 22.015),
    LibraryObject(13, 6205, "GLOB CLUS", 250.423, 36.461),
    LibraryObject(31, 224, "GALAXY", 10.685, 41.269),
    LibraryObject(42, 1976, "DIFF NEB", 83.822, -5.391),
    LibraryObject(45, 0, "OPEN CLUS", 56.75, 24.117),
    LibraryObject(57, 6720, "PLAN NEB", 283.396, 33.029),
)
_STARS = {7: (37.955, 89.264), 308: (279.234, 38.784)}  # of the STAR library: Polaris, Vega
_DEEP_SKY_CATALOGUES, _STAR_CATALOGUES = (0, 1, 2), (0, 1, 2)
_STEPS = {"LF": 0, "LN": 1, "LB": -1}
_SKY = Sky()


def _set_target(sim: MeadeTelescope, ra: float, dec: float, name: str) -> None:
    sim.stored_values["ra"], sim.stored_values["dec"] = _SKY.from_j2000(ra, dec, sim.utc())
    sim.stored_values["object"] = name


def select_object(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:LM :LC - select a Messier or catalogue object."""
    number = values["number"]
    for thing in _OBJECTS:
        if number and number == (thing.messier if command == "LM" else thing.ngc):
            _set_target(sim, thing.ra, thing.dec, f"{'M' if command == 'LM' else 'CNGC'}{number} {thing.kind}")


def select_star(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:LS - select a star."""
    place = _STARS.get(values["number"])
    if place is not None:
        _set_target(sim, *place, f"STAR{values['number']}")


def step_object(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:LF :LN :LB - the first, next or previous object above the horizon; only on a classic."""
    if not sim.classic:
        return
    up = [thing for thing in _OBJECTS if altitude(sim, *_SKY.from_j2000(thing.ra, thing.dec, sim.utc())) > 0]
    if up:
        index = (sim.stored_values.get("step", 0) + _STEPS[command]) % len(up) if _STEPS[command] else 0
        sim.stored_values["step"] = index
        _set_target(sim, up[index].ra, up[index].dec, f"M{up[index].messier} {up[index].kind}")


def select_catalogue(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:Lo :Ls - select a catalogue; "not found" is 0 for :Lo and 2 for :Ls, and only a classic sends it."""
    present = values["catalog"] in (_DEEP_SKY_CATALOGUES if command == "Lo" else _STAR_CATALOGUES)
    if present or not sim.classic:
        return b"1"
    return b"0" if command == "Lo" else b"2"


def describe(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:LI :Lf - describe the selected object, or the objects in the field."""
    if not sim.classic:
        return f"{sim.facts['object_text' if command == 'LI' else 'find_text']}#".encode()
    return f"{sim.stored_values.get('object', 'No object')}#".encode() if command == "LI" else b"0 - Objects found#"


def select_moon(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:SE :Se - make the Moon's centre the target, whatever the feature; reply 0 while it is below the horizon."""
    ra, dec, _ = _SKY.moon(sim.utc(), *sim.site)
    if altitude(sim, ra, dec) <= 0:
        return b"0"
    sim.stored_values["ra"], sim.stored_values["dec"], sim.stored_values["object"] = ra, dec, "MOON"
    return b"1"


HANDLERS: dict[str, Handler] = {
    "LM": select_object, "LC": select_object, "LS": select_star, "LF": step_object, "LN": step_object,
    "LB": step_object, "Lo": select_catalogue, "Ls": select_catalogue, "LI": describe, "Lf": describe,
    "SE": select_moon, "Se": select_moon,
}  # fmt: skip
