"""The commands of a simulated OnStepX or TeenAstro: those that a Meade does not have, or answers otherwise."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial

from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator import answers, motion, settings, tracking
from gateway.protocols.lx200.simulator.controllers import ACK, ARROW_ENDS, HOME, Controller
from gateway.protocols.mechanics.simulated import Later
from gateway.protocols.wireformat import sexagesimal


def _slew(sim: Controller, name: str, _: Values) -> bytes:
    ra, dec = sim.kept.get("ra", 0.0), sim.kept.get("dec", 0.0)
    if name == "MA":
        ra, dec = motion.from_horizon(sim)
    return sim.go(ra, dec, motion.altitude(sim, ra, dec))


def _sync(sim: Controller, _: str, __: Values) -> bytes:
    if (no := sim.refusal(0.0)) is not None:
        return b"E" + no + b"#" if sim.onstep else b""
    motion.sync(sim, "CM", {})
    sim.at_home = False
    return b"N/A#"


def _arrow(sim: Controller, name: str, _: Values) -> None:
    axis, sense = motion.axis_of(sim, name[1])
    if sim.parked or sim.standby:
        return
    if sim.mechanics.slewing(sim.now):
        sim.mechanics.cancel(sim.now)
        return
    if sim.kept.get(f"arrow {axis}") == name and axis in sim.ends:
        return
    sim.at_home, sim.kept[f"arrow {axis}"] = False, name
    sim.ends[axis] = sim.now + ARROW_ENDS if sim.onstep else math.inf
    sim.mechanics.move(sim.now, axis, sense * sim.times(sim.rate) * SIDEREAL_RATE, gentle=True)


def _let_go(sim: Controller, name: str, _: Values) -> None:
    sim.let_go(sim.now, motion.axis_of(sim, name[1])[0])


def _stop(sim: Controller, _: str, __: Values) -> None:
    sim.let_go(sim.now, *sim.ends)
    sim.mechanics.cancel(sim.now)
    sim.parking = sim.homing = False


def _pulse(sim: Controller, _: str, values: Values) -> None:
    if sim.parked or sim.standby or sim.mechanics.slewing(sim.now):
        return
    axis, sense = motion.axis_of(sim, values["direction"])
    rate = sim.pulse_rate if sim.separate_pulses else sim.rate
    sim.mechanics.pulse(sim.now, axis, sense * sim.times(rate) * SIDEREAL_RATE, values["ms"] / 1000.0)


def _drive(sim: Controller, name: str, _: Values) -> None:
    tracking.drive(sim, name, _)
    sim.kept["hertz"] = {"TQ": 60.16427, "TS": 60.0, "TL": 57.9}[name]


def _set_drive(sim: Controller, _: str, values: Values) -> bytes:
    if not 30.0 <= values["hertz"] < 90.0:
        return b"0"
    sim.kept["hertz"] = values["hertz"]
    sim.mechanics.set_drive_rate(sim.now, values["hertz"] / 60.16427 * SIDEREAL_RATE)
    return sim.switch(True) if sim.onstep else b"1"


def _zone(sim: Controller, _: str, values: Values) -> bytes:
    """:SG - the clock goes on in UTC. A TeenAstro reads a number, as far as it goes."""
    offset = values["offset"]
    if not -14.0 < offset <= 12.0 or (sim.onstep and round(offset % 1 * 60) not in (0, 30, 45)):
        return b"0"
    if not sim.onstep and offset < -12.0:
        return b"0"
    sim.offset = -offset
    return b"1"


def _tell_zone(sim: Controller, _: str, __: Values) -> bytes:
    hours, minutes = divmod(round(abs(sim.offset) * 60), 60)
    sign = "-" if sim.offset > 0 else "+"
    return (f"{sign}{hours:02d}:{minutes:02d}#" if sim.onstep else f"{-sim.offset:+05.1f}#").encode()


def _set_clock(sim: Controller, name: str, values: Values) -> bytes:
    sim.standby.discard(name)
    if not sim.standby and sim.onstep:
        sim.aligned = True
    if name == "SXT2":
        sim.ahead = values["unix"] - sim.now
        sim.relocate()
    elif name == "SC" and not sim.onstep:
        sim.ahead += (values["date"] - datetime.fromtimestamp(sim.utc(), UTC).date()) / timedelta(seconds=1)
        sim.relocate()
    else:
        settings.HANDLERS[name](sim, name, values)
    return b"1"


def _site(sim: Controller, name: str, values: Values) -> bytes:
    if not (sim.onstep or sim.at_home or sim.parked):
        return b"0"
    settings.set_half(sim, name, values)
    return b"1"


def _tell_site(sim: Controller, name: str, _: Values) -> bytes:
    return answers.form(sim, name, latitude=sim.site[0], longitude=wrap180(-sim.site[1]))


def _horizon(sim: Controller, name: str, _: Values) -> bytes:
    return answers.horizon(sim, name, _).replace(b":", b"'")


def _fine(sim: Controller, name: str) -> bytes:
    """:GRa :GDe :GRL :GDL - in high precision at all times. :GtH :GgH - with seconds and their thousandths."""
    if (template := sim.protocol.commands[name[:2]].form("fine")) is not None and name[1] in "RD":
        return template.encode(dict(zip(("ra", "dec"), sim.position(), strict=True)))
    text = sexagesimal.signed(sim.site[0]) if name == "GtH" else "+" + sexagesimal.azimuth(-sim.site[1] % 360.0)
    return text.encode() + b".000#"


def _toggle(sim: Controller) -> bytes:
    """:U - unknown to an OnStepX."""
    if sim.onstep and not sim.older:
        return b"0"
    sim.high = not sim.high
    return b""


def _set_park(sim: Controller) -> bytes:
    sim.park_place = sim.mechanics.axes(sim.now)
    return b"1"


#: Those of the next ones that only one of the two has.
OF_ONSTEP = {"GU", "GX90", "GX97", "GtH", "GgH", "GRa", "GDe"}
OF_TEENASTRO = {"GXT2", "GXRX", "GRL", "GDL"}
#: Commands without an argument, for which the driver has no row or which it answers by its state.
WORDS: dict[str, Callable[[Controller], bytes]] = {
    "GU": Controller.letters, "GW": Controller.state, "Gm": Controller.side,
    "GT": Controller.hertz, "Te": lambda sim: sim.switch(True), "Td": lambda sim: sim.switch(False),
    "U": _toggle, "hQ": _set_park, "hP": lambda sim: sim.leave(sim.park_place, True), "hR": Controller.unpark,
    "hC": lambda sim: b"" if sim.leave(HOME, False) and sim.onstep else b"1", "hF": Controller.declare_home,
    "GXT2": lambda sim: f"{sim.utc():.0f}#".encode(), "GXRX": lambda sim: f"{sim.times(4):.0f}#".encode(),
    "GX97": lambda sim: f"{sim.mechanics.fastest:.1f}#".encode(),
    "GX90": lambda sim: f"{sim.times(sim.pulse_rate):.2f}#".encode(),
    **{name: partial(_fine, name=name) for name in ("GtH", "GgH", "GRa", "GDe", "GRL", "GDL")},
    "Gh": lambda sim: f"{sim.kept['lowest']:+03.0f}*#".encode(),
    "Go": lambda sim: f"{sim.kept['highest']:02.0f}*#".encode(),
    **{f"R{letter}": partial(Controller.select, letter=letter) for letter in "GCMFS0123456789"},
}  # fmt: skip
TARGETS, SEPARATORS = ("Sr", "Sd", "Sa", "Sz"), re.compile(rb"[*:'\xdf]")
HANDLERS: dict[str, Callable[[Controller, str, Values], bytes | None]] = {
    **{name: answers.HANDLERS[name] for name in ("D", "GD", "GR", "Gd", "Gr", "GVD", "GVN", "GVP", "GVT")},
    **{name: settings.HANDLERS[name] for name in ("GC", "GL", "GS", "Gc")},
    **dict.fromkeys(TARGETS, motion.set_target), **dict.fromkeys(("MS", "MA"), _slew),
    "CM": _sync, **dict.fromkeys(("Mn", "Ms", "Me", "Mw"), _arrow), **dict.fromkeys(("Qn", "Qs", "Qe", "Qw"), _let_go),
    "Q": _stop, "Mg": _pulse, **dict.fromkeys(("TQ", "TS", "TL"), _drive), "ST": _set_drive, "SG": _zone,
    "GG": _tell_zone, **dict.fromkeys(("SL", "SC", "SXT2"), _set_clock), **dict.fromkeys(("St", "Sg"), _site),
    **dict.fromkeys(("Gt", "Gg"), _tell_site), **dict.fromkeys(("GZ", "GA"), _horizon),
}  # fmt: skip


class SimulatedController(Controller):
    """One of the two, with its serial port."""

    def takes(self, frame: bytes) -> bool:
        """Whether a TeenAstro takes a target of this form: in high precision with seconds alone."""
        seconds = len(SEPARATORS.findall(frame[3:])) > 1
        return frame[3:4] == b"L" or (seconds if self.high else not seconds or frame[2:3] in b"az")

    def answer(self, frame: bytes, later: Later | None) -> bytes:
        if frame == ACK:
            return b"P" if self.onstep else b"G"
        word = frame[1:-1].decode("latin-1")
        assert self.protocol.other is not None
        if (fixed := self.protocol.other.facts["simulated"].get(word)) is not None:
            return str(fixed).encode()
        if (answer := WORDS.get(word)) is not None and word not in (OF_TEENASTRO if self.onstep else OF_ONSTEP):
            return answer(self)
        found = self.protocol.find(frame)
        handler = HANDLERS.get(found[0].name) if found is not None else None
        if found is None or handler is None:
            return b"0" if self.onstep else b"#" if word[:1] == "G" else b""
        if not self.onstep and found[0].name in TARGETS and not self.takes(frame):
            return b"0"
        try:
            values = found[1].decode(frame)
        except ValueError:
            return self._no(found[0])
        return handler(self, found[0].name, values) or b""
