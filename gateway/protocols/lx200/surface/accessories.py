"""Formats, home and park, focuser, drive corrections: the small commands."""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core.errors import Invalid, Unsupported
from gateway.core.operations import Backlash, Focus, HomeState, PeriodicError, Unpark, Values
from gateway.protocols.base.wants import FireAndForget, Handling, Speed, given
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command


def toggle_precision(session: LxSession, command: Command, values: Values) -> None:
    """:U - the format of coordinates, for this client."""
    session.kept.precision = "low" if session.kept.precision == "high" else "high"


#: The digit of :SB -> baud. The manual prints the first one as 56.7K.
RATES = {1: 57600, 2: 38400, 3: 28800, 4: 19200, 5: 14400, 6: 9600, 7: 4800, 8: 2400, 9: 1200}


def baud(session: LxSession, command: Command, values: Values) -> Handling:
    """:SB - 1 at the old rate; a network connection has none. Raises Invalid for what is none of the nine."""
    if values.get("rate") not in RATES:
        raise Invalid("The baud rates are 1 to 9.")
    yield Speed(RATES[values["rate"]])


def restart(session: LxSession, command: Command, values: Values) -> Handling:
    """:I - back into service, and this client's state as at power-on; the stop in it was begun when it came."""
    session.forget()
    yield FireAndForget(Unpark())


def home_state(session: LxSession, command: Command, values: Values) -> Handling:
    """:h? - 0 of a telescope that has no way home: it was not found."""
    try:
        return {"state": str((yield HomeState()))}
    except Unsupported:
        return {"state": "0"}


def focus(session: LxSession, command: Command, values: Values) -> Handling:
    """:F+ :F- :FQ"""
    direction = {"+": 1, "-": -1, "Q": 0}[command.name[1]]
    yield FireAndForget(Focus(direction, session.kept.focus_speed))


def focus_speed(session: LxSession, command: Command, values: Values) -> None:
    """:FF :FS :F<n> - 1 to 4; any other number leaves the speed as it was. Raises Invalid."""
    speed = {"FF": 4, "FS": 1}.get(command.name) or given(values)["speed"]
    if not 1 <= speed <= 4:
        raise Invalid("The focus speeds are 1 to 4.")
    session.kept.focus_speed = speed


def backlash(session: LxSession, command: Command, values: Values) -> Handling:
    """:$BA the declination motor, :$BZ the right-ascension motor."""
    yield FireAndForget(Backlash(2 if command.name == "$BA" else 1, given(values)["value"]))


def periodic_error(session: LxSession, command: Command, values: Values) -> Handling:
    """$Q :$QA :$QZ - a toggle for both axes, or on and off for one; the toggle goes by right ascension's."""
    if command.name.startswith("$QA"):
        yield FireAndForget(PeriodicError(2, command.name.endswith("+")))
        return
    toggled = command.name == "$Q"
    on = not session.shared.pec if toggled else command.name.endswith("+")
    session.set_for_all(replace(session.shared, pec=on))
    yield FireAndForget(PeriodicError(None if toggled else 1, on))


def silence(session: LxSession, command: Command, values: Values) -> bytes:
    """Nothing needs doing, and nothing is what programs take best; or nothing true could be said."""
    return b""
