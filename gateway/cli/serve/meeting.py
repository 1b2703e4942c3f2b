"""What is printed while a mount is looked for, and when none was found: what was asked, what came, what that means."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway.core.wire_log import show
from gateway.protocols.registry import PROTOCOLS

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: Seconds after which it is said what is waited for.
SAID_AFTER = 1.0


def waiting(gateway: Gateway) -> str:
    """What is waited for, and how long it may take."""
    spec = PROTOCOLS[gateway.mount.protocol]
    takes = spec.takes[gateway.mount.model is None]
    controller = gateway.controller
    if controller is not None and controller.context.milestones.met.is_set():
        return (
            f"{gateway.title}: a mount is there, and programs are told where it points; which model it is may take "
            f"it {takes} s to say"
        )
    return f"{gateway.title}: waiting for the mount's first answer; {spec.slowest} may take {takes} s"


def not_found(gateway: Gateway) -> str:
    """Why no mount was found, and what to do; the cable is only doubted where nothing ever came."""
    assert gateway.controller is not None
    talk, where = gateway.controller.line.talk, gateway.mount.where
    look = f"mount-gateway detect {where} looks closer" if "://" in where else "mount-gateway detect tries every port"
    rest = f"{look}, --wait keeps trying"
    if not talk.heard_ever:
        return f"{gateway.title}: no mount answers (is it switched on, and the cable in the hand control?); {rest}"
    asked, came = talk.trouble
    answer = f"it answered {show(came)}" if came else "it did not answer that"
    kind = PROTOCOLS[gateway.mount.protocol].mounts
    return (
        f"{gateway.title}: something is there, and no {kind} was found. The last question that went wrong was "
        f"{show(asked)}: {answer}. So the cable carries bytes; the baud rate may be another one, or the mount "
        f"speaks another protocol; {rest}"
    )


def where_else(where: str) -> str:
    """What to look at when a mount's port or address cannot be opened."""
    if where.startswith(("socket://", "rfc2217://")):
        return "is it switched on, in the same network, and is the number of its port right?"
    return "mount-gateway detect shows which ports there are"
