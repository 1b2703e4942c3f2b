"""The help text: what answers here, which mount stands behind it, and how to ask. A page of lines for each client."""

from __future__ import annotations

from gateway.core.about import VERSION
from gateway.core.errors import Fault
from gateway.core.operations import GetIdentity, GetStatus, Identity, Status, Values
from gateway.protocols.base.wants import Handling
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

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


def help_line(session: LxSession, command: Command, values: Values) -> Handling:
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
        identity: Identity = yield GetIdentity()
        status: Status = yield GetStatus()
    except Fault as fault:
        mount: tuple[str, ...] = (f"Mount: {fault}",)
    else:
        build = "equatorial" if status.equatorial else "alt-azimuth"
        mount = (
            f"Mount: {identity.product} {identity.model}, version {identity.version}",
            f"It is {'aligned' if status.aligned else 'NOT aligned'}, {build}, tracking {status.tracking.value}",
        )
    return (f"mount-gateway {VERSION}: this is no Meade", *mount, *_USAGE)
