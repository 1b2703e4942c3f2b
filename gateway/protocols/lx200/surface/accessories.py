"""The small commands: formats, home, focuser, drive corrections, and the help text.

The help says what answers here, which mount stands behind it, and how to ask: a page of lines for each client.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.about import VERSION
from gateway.core.errors import Fault, Invalid, Unsupported
from gateway.protocols.base.wants import FireAndForget, Handling, Speed, given
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

#: The digit of :SB -> baud. The manual prints the first one as 56.7K.
RATES = {1: 57600, 2: 38400, 3: 28800, 4: 19200, 5: 14400, 6: 9600, 7: 4800, 8: 2400, 9: 1200}
_STEPS = {"??": None, "?+": 1, "?-": -1}
#: Without the hash sign, which would end the line.
_USAGE = (
    "Every command ends with a hash sign",
    "Target by place:   :Sr05:34:32 and :Sd+22*00:52",
    "Messier object:    :LM42",
    "NGC object:        :Lo0 and :LC7331",
    "IC, Caldwell:      :Lo1, :Lo3 and :LC14",
    "Hipparcos star:    :Ls3 and :LS32349",
    "Planet, the Moon:  :Ls0 and :LS905, :LS903",
    "Place on the Moon: :SE+17*00 and :Se+059*00",
    "Go there:          :MS, 0 is yes",
    "Where is it:       :GR :GD :GA :GZ",
    "Stop everything:   :Q",
    "More: mount-gateway explain lx200 nexstar :MS",
)


def toggle_precision(session: LxSession, command: Command, values: op.Values) -> None:
    """:U - the format of coordinates, for this client."""
    session.kept.precision = "low" if session.kept.precision == "high" else "high"


def baud(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:SB - 1 at the old rate; a network connection has none. Raises Invalid for what is none of the nine."""
    if values.get("rate") not in RATES:
        raise Invalid("The baud rates are 1 to 9.")
    yield Speed(RATES[values["rate"]])


def restart(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:I - back into service, and this client's state as at power-on; the stop in it was begun when it came."""
    session.forget()
    yield FireAndForget(op.Unpark())


def home_state(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:h? - 0 of a telescope that has no way home: it was not found."""
    try:
        return {"state": str((yield op.HomeState()))}
    except Unsupported:
        return {"state": "0"}


def focus(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:F+ :F- :FQ"""
    direction = {"+": 1, "-": -1, "Q": 0}[command.name[1]]
    yield FireAndForget(op.Focus(direction, session.kept.focus_speed))


def focus_speed(session: LxSession, command: Command, values: op.Values) -> None:
    """:FF :FS :F<n> - 1 to 4; any other number leaves the speed as it was. Raises Invalid."""
    speed = {"FF": 4, "FS": 1}.get(command.name) or given(values)["speed"]
    if not 1 <= speed <= 4:
        raise Invalid("The focus speeds are 1 to 4.")
    session.kept.focus_speed = speed


def backlash(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:$BA the declination motor, :$BZ the right-ascension motor."""
    yield FireAndForget(op.Backlash(2 if command.name == "$BA" else 1, given(values)["value"]))


def periodic_error(session: LxSession, command: Command, values: op.Values) -> Handling:
    """$Q :$QA :$QZ - a toggle for both axes, or on and off for one; the toggle goes by right ascension's."""
    if command.name.startswith("$QA"):
        yield FireAndForget(op.PeriodicError(2, command.name.endswith("+")))
        return
    toggled = command.name == "$Q"
    on = not session.shared.pec if toggled else command.name.endswith("+")
    session.set_for_all(replace(session.shared, pec=on))
    yield FireAndForget(op.PeriodicError(None if toggled else 1, on))


def silence(session: LxSession, command: Command, values: op.Values) -> bytes:
    """Nothing needs doing, and nothing is what programs take best; or nothing true could be said."""
    return b""


# --- help -------------------------------------------------------------------------------------------------------------


def help_line(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:?? :?+ :?- - an empty line before the first and after the last; models without help say nothing."""
    if not session.model["help"]:
        return b""
    kept = session.kept
    step = _STEPS[command.name]
    if step is None or not kept.help:
        kept.help = yield from _text()
        kept.help_line = 0
    else:
        kept.help_line = max(-1, min(len(kept.help), kept.help_line + step))
    return {"text": kept.help[kept.help_line] if 0 <= kept.help_line < len(kept.help) else ""}


def _text() -> Handling:
    """-> the lines, as things stand now."""
    try:
        identity: op.Identity = yield op.GetIdentity()
        status: op.Status = yield op.GetStatus()
    except Fault as fault:
        mount: tuple[str, ...] = (f"Mount: {fault}",)
    else:
        build = "equatorial" if status.equatorial else "alt-azimuth"
        mount = (
            f"Mount: {identity.product} {identity.model}, version {identity.version}",
            f"It is {'aligned' if status.aligned else 'NOT aligned'}, {build}, tracking {status.tracking.value}",
        )
    return (f"mount-gateway {VERSION}: this is no Meade", *mount, *_USAGE)
