"""What hangs on a simulated Meade: focuser, smart drive, backlash, fan, derotator, reticle, GPS power.

None of it can be asked for over the line; ``parts`` shows it to whoever watches.
"""

from __future__ import annotations

from gateway.core.operations import Values
from gateway.protocols.lx200.simulator.answers import form
from gateway.protocols.lx200.simulator.telescope import Handler, Telescope

_SLOWEST, _FASTEST = 1, 4
_SWITCHES = {"f": "fan", "r": "derotator", "g": "gps"}


def focus(sim: Telescope, name: str, _: Values) -> None:
    """:F+ in, :F- out, :FQ"""
    sim.parts["focuser"] = {"+": 1, "-": -1, "Q": 0}[name[1]]


def focus_speed(sim: Telescope, name: str, values: Values) -> None:
    """:FF :FS :F<n>"""
    sim.parts["focus speed"] = {"FF": _FASTEST, "FS": _SLOWEST}.get(name) or values["speed"]


def switch(sim: Telescope, name: str, _: Values) -> None:
    """:f+ :f- :r+ :r- :g+ :g-"""
    sim.parts[_SWITCHES[name[0]]] = name[1] == "+"


def backlash(sim: Telescope, name: str, values: Values) -> None:
    """:$BA the second axis, :$BZ the first."""
    sim.parts[f"backlash {2 if name == '$BA' else 1}"] = values["value"]


def correct(sim: Telescope, name: str, _: Values) -> None:
    """$Q the other way round on both axes, :$QA :$QZ on and off for one."""
    if name == "$Q":
        wanted = not sim.parts.get("pec 1", False)
        sim.parts["pec 1"] = sim.parts["pec 2"] = wanted
    else:
        sim.parts[f"pec {2 if name[2] == 'A' else 1}"] = name.endswith("+")


def reticle(sim: Telescope, name: str, values: Values) -> None:
    """:B+ :B- :B<n> :BD"""
    if name in ("B+", "B-"):
        sim.parts["reticle"] = sim.parts.get("reticle", 0) + (1 if name == "B+" else -1)
    else:
        sim.parts["reticle flash" if name == "B" else "reticle duty"] = next(iter(values.values()))


def temperature(sim: Telescope, name: str, _: Values) -> bytes:
    """:fT"""
    return form(sim, name, value=12.5)


HANDLERS: dict[str, Handler] = {
    **dict.fromkeys(("F+", "F-", "FQ"), focus), **dict.fromkeys(("FF", "FS", "F"), focus_speed),
    **dict.fromkeys(("f+", "f-", "r+", "r-", "g+", "g-"), switch), "$BA": backlash, "$BZ": backlash,
    **dict.fromkeys(("$Q", "$QA+", "$QA-", "$QZ+", "$QZ-"), correct), **dict.fromkeys(("B+", "B-", "B", "BD"), reticle),
    "fT": temperature,
}  # fmt: skip
