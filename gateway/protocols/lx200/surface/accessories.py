"""The smaller commands: formats, home, focuser, drive corrections, and the help text.

The help text says that this is a gateway, which mount it controls, and how its commands are written.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.about import version
from gateway.core.errors import Fault, Invalid, Unsupported
from gateway.protocols.base.wants import ChangeBaudRate, FireAndForget, Handling, decoded
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

#: Digit of :SB -> baud rate. The manual prints the first rate as 56.7K.
BAUD_RATE_BY_DIGIT = {1: 57600, 2: 38400, 3: 28800, 4: 19200, 5: 14400, 6: 9600, 7: 4800, 8: 2400, 9: 1200}
_LINE_STEP_BY_COMMAND = {"??": None, "?+": 1, "?-": -1}
#: These lines have no hash sign, because it would end the line.
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


def toggle_precision(session: LxSession) -> None:
    """:U - toggle the format of coordinates for this client."""
    session.client.precision = "low" if session.client.precision == "high" else "high"


def change_baud_rate(values: op.Values) -> Handling:
    """:SB - reply 1 at the old baud rate, then change it on a serial port. Raises Invalid for any digit but 1-9."""
    if values.get("rate") not in BAUD_RATE_BY_DIGIT:
        raise Invalid("The baud rates are 1 to 9.")
    yield ChangeBaudRate(BAUD_RATE_BY_DIGIT[values["rate"]])


def restart(session: LxSession) -> Handling:
    """:I - unpark, and reset this client's settings. Like any urgent command it has stopped the mount on arrival."""
    session.reset_client()
    yield FireAndForget(op.Unpark())


def home_state() -> Handling:
    """:h? - the state of homing: 0 (not found) also for a telescope without a home position."""
    try:
        return {"state": str((yield op.HomeState()))}
    except Unsupported:
        return {"state": "0"}


def focus(session: LxSession, command: Command) -> Handling:
    """:F+ :F- :FQ - move or stop the focuser."""
    direction = {"+": 1, "-": -1, "Q": 0}[command.name[1]]
    yield FireAndForget(op.Focus(direction, session.client.focus_speed))


def set_focus_speed(session: LxSession, command: Command, values: op.Values) -> None:
    """:FF :FS :F<n> - set the focuser's speed, 1 to 4. Raises Invalid for any other number."""
    speed = {"FF": 4, "FS": 1}.get(command.name) or decoded(values)["speed"]
    if not 1 <= speed <= 4:
        raise Invalid("The focus speeds are 1 to 4.")
    session.client.focus_speed = speed


def set_backlash(command: Command, values: op.Values) -> Handling:
    """:$BA :$BZ - set the backlash of the declination motor or of the right ascension motor."""
    yield FireAndForget(op.Backlash(2 if command.name == "$BA" else 1, decoded(values)["value"]))


def switch_pec(session: LxSession, command: Command) -> Handling:
    """$Q :$QA :$QZ - turn PEC on or off: $Q toggles both axes by the state of right ascension, the others set one."""
    if command.name.startswith("$QA"):
        yield FireAndForget(op.PeriodicError(2, command.name.endswith("+")))
        return
    toggled = command.name == "$Q"
    on = not session.shared.pec if toggled else command.name.endswith("+")
    session.replace_shared(replace(session.shared, pec=on))
    yield FireAndForget(op.PeriodicError(None if toggled else 1, on))


def silence() -> bytes:
    """Send no reply: there is nothing to do and programs cope best with silence, or no true reply exists."""
    return b""


# --- help -------------------------------------------------------------------------------------------------------------


def help_line(session: LxSession, command: Command) -> Handling:
    """:?? :?+ :?- - first, next, previous line of help; empty beyond both ends. No reply on models without help."""
    if not session.model["help"]:
        return b""
    client = session.client
    step = _LINE_STEP_BY_COMMAND[command.name]
    if step is None or not client.help_lines:
        client.help_lines = yield from _help_text()
        client.help_line = 0
    else:
        client.help_line = max(-1, min(len(client.help_lines), client.help_line + step))
    return {"text": client.help_lines[client.help_line] if 0 <= client.help_line < len(client.help_lines) else ""}


def _help_text() -> Handling:
    """Return the lines of the help text, with the present state of the mount."""
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
    return (f"mount-gateway {version()}: this is not a Meade", *mount, *_USAGE)
