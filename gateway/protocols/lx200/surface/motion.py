"""Arrows, their rates, and guiding. No command here has a reply, but :Sw."""

from __future__ import annotations

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core.errors import Invalid
from gateway.core.operations import Direction, Move, Pulse, Rate, SetGuideRate, Values
from gateway.protocols.base.wants import FireAndForget, Handling, given
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

_NAMES = {"RG": "guide", "RC": "center", "RM": "find", "RS": "max"}
LONGEST_PULSE = 60_000


def move(session: LxSession, command: Command, values: Values) -> Handling:
    """:Mn :Ms :Me :Mw - at this client's rate."""
    direction = Direction(command.name[1])
    kept = session.kept
    own = kept.rate_ra if direction.axis == 1 else kept.rate_dec
    rate = kept.rate or Rate(name="center")
    if own:
        rate = Rate(degrees=own if kept.fastest is None else min(own, kept.fastest))
    elif rate.name == "max" and kept.fastest is not None:
        rate = Rate(name="max", degrees=kept.fastest)
    yield FireAndForget(Move(direction, rate, lowest=kept.lowest, highest=kept.highest))


def choose_rate(session: LxSession, command: Command, values: Values) -> None:
    """:RG :RC :RM :RS, and :R<n> with the key's own number (0 is the slowest)."""
    name = _NAMES.get(command.name)
    session.kept.rate = Rate(name=name) if name else Rate(key=max(1, given(values)["key"]))
    session.kept.rate_ra = session.kept.rate_dec = None


def axis_rate(session: LxSession, command: Command, values: Values) -> None:
    """:RA :RE - degrees a second for the arrows of one axis, until another rate is chosen."""
    rate = given(values)["rate"] or None
    if command.name == "RA":
        session.kept.rate_ra = rate
    else:
        session.kept.rate_dec = rate


def max_rate(session: LxSession, command: Command, values: Values) -> None:
    """:Sw - the fastest rate for this client; some programs use it as their rate slider, so it is chosen, too."""
    low, high = session.model["max_rates"]
    if "fault" in values or not low <= values["rate"] <= max(high, 8):
        raise Invalid(f"The slew rate is {low} to {high} degrees a second.")
    session.kept.fastest = float(values["rate"])
    session.kept.rate = Rate(name="max")


def guide_rate(session: LxSession, command: Command, values: Values) -> Handling:
    """:Rg - arcseconds a second, at most sidereal."""
    fraction = min(1.0, given(values)["rate"] / SIDEREAL_ARCSECONDS)
    for axis in (1, 2):
        yield FireAndForget(SetGuideRate(axis, fraction))


def pulse(session: LxSession, command: Command, values: Values) -> Handling:
    """:Mg - a timed guide pulse in milliseconds."""
    values = given(values)
    yield FireAndForget(Pulse(Direction(values["direction"]), min(values["ms"], LONGEST_PULSE)))
