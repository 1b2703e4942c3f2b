"""The help text: what answers here, which mount stands behind it, and how to ask. A page of lines for each client."""

from __future__ import annotations

from typing import Any

from gateway import __version__
from gateway.errors import Fault
from gateway.operations import GetIdentity, GetStatus, Identity, Status
from gateway.surface import Handling, Session
from gateway.tables import Command

_STEPS = {"??": None, "?+": 1, "?-": -1}
_USAGE = (
    "Set a target: :Sr05:34:32# :Sd+22*00:52#",
    "or an object: :LM42# Messier, :LC7331# NGC,",
    ":Lo1# IC, :Lo3# Caldwell before :LC,",
    ":Ls3# Hipparcos before :LS.",
    "Go there: :MS#  0 = on the way",
    "Stop everything: :Q#",
    "Arrows: :Mn# :Ms# :Me# :Mw#, rates :RG# :RC# :RM# :RS#",
    "Where is it: :GR# :GD#, :GA# :GZ#",
    "Next line: :?+#  line before: :?-#  first: :??#",
    "On the computer: mount-gateway explain lx200 nexstar :MS#",
)


def help_line(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:?? :?+ :?- - an empty line before the first and after the last; models without help say nothing."""
    if not session.model["help"]:
        return b""
    kept = session.kept
    step = _STEPS[command.name]
    if step is None or "help" not in kept:
        kept["help"] = yield from _text()
        kept["help line"] = 0
    else:
        kept["help line"] = max(-1, min(len(kept["help"]), kept["help line"] + step))
    line = kept["help line"]
    return {"text": kept["help"][line] if 0 <= line < len(kept["help"]) else ""}


def _text() -> Handling:
    """-> the lines, as things stand now."""
    try:
        identity: Identity = yield GetIdentity()
        status: Status = yield GetStatus()
    except Fault as fault:
        mount: tuple[str, ...] = (f"Mount: {fault}",)
    else:
        build = "equatorial" if status.equatorial else "alt-azimuth"
        mount = (
            f"Mount: {identity.product} {identity.version}".strip(),
            f"It is {'aligned' if status.aligned else 'NOT aligned'}, {build}, tracking {status.tracking.value}",
        )
    return (f"mount-gateway {__version__}: this is no Meade", *mount, *_USAGE)
