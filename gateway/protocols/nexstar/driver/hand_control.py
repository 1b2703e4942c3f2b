"""The hand control itself, for programs that speak its protocol: what it presents, and what it answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gateway.core.errors import Silence, Unsupported
from gateway.core.operations import Own
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.nexstar.versions import NEXSTAR_VARIANT, STARSENSE_VARIANT
from gateway.protocols.wireformat.rows import Version

if TYPE_CHECKING:
    from gateway.protocols.nexstar.driver.state import NexStar

#: What is shown of a hand control that has not told its version yet.
FIRST_SHOWN: Version = (4, 21)
#: Seconds in which a hand control says which kind it is, or does not.
VARIANT_PATIENCE = 1.5


def presented(mount: NexStar) -> dict[str, Any]:
    """The row of its model, with what it has told of itself; ``counts_as`` is the version that it behaves as."""
    shown = mount.shown or FIRST_SHOWN
    return {
        **mount.facts,
        "id": mount.facts.get("id", mount.number or 0),
        "name": mount.model or "unknown",
        "version": shown,
        "counts_as": mount.version or shown,
        "own": True,
        "variant": STARSENSE_VARIANT if mount.starsense else NEXSTAR_VARIANT,
    }


def own(mount: NexStar, operation: Own) -> Steps:
    """-> bytes. Nobody knows of every version whether it answers to ``v``; all else is answered by who has it.

    Raises Unsupported for what it has not, or does not answer.
    """
    if not mount.knows(operation.command) or operation.command in mount.mute:
        raise Unsupported
    patience = VARIANT_PATIENCE if operation.command == "v" else None
    try:
        return (yield Send(operation.command, dict(operation.fields), patience, raw=True))["raw"]
    except Silence:
        mount.mute.add(operation.command)
        raise Unsupported from None
