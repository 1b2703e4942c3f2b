"""Finding the mount of one gateway: how long it is waited for, and what is said meanwhile and where there is none.

What is said tells what was asked, what came, what that means, and what helps.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING

from gateway.core.errors import UserError
from gateway.core.wire_log import show
from gateway.protocols.registry import PROTOCOLS

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: How long a mount may take to say its first word (a hand control's worst), the first that makes sense where bytes
#: come, and all that it is asked.
FIRST_WORD, FIRST_SENSE, FIND_MOUNT = 4.0, 10.0, 20.0
#: What every mount talks at that nobody has set to anything else, baud.
USUAL = 9600
#: With --wait, how long the ready lines wait for the mount to say what fits it.
QUICK = 0.5
#: How the reason begins of a line whose port cannot be opened.
CANNOT_OPEN = "cannot open"
#: Seconds after which it is said what is waited for.
SAID_AFTER = 1.0


async def serve(
    gateway: Gateway,
    patient: bool,
    start_sky: Callable[[], None],
    ready: Callable[[Gateway], None],
    warn: Callable[[str], None],
) -> None:
    """Find one mount and say that it is ready. Raises UserError for one that is not there, unless there is patience."""
    if not patient:
        await _find(gateway, warn)
    start_sky()
    found = not patient or await gateway.found(QUICK)
    ready(gateway)
    if not found and not await _found(gateway, warn):
        reason = gateway.controller.line.reason or "no answer"
        at = f" at {gateway.config.baud} baud (mounts talk at {USUAL})" * (gateway.config.baud != USUAL)
        warn(f"{gateway.title}: {reason}{at}; the gateway keeps trying")


async def _found(gateway: Gateway, warn: Callable[[str], None]) -> bool:
    """Wait for the mount -> whether it is there; False as soon as there is little hope."""
    line, now = gateway.controller.line, asyncio.get_running_loop().time
    began, said = now(), False
    while now() < began + FIND_MOUNT:
        if await gateway.found(0.1):
            return True
        hope = FIRST_SENSE if line.talk.heard_ever else FIRST_WORD
        if line.reason.startswith(CANNOT_OPEN) or (line.answers == 0 and now() > began + hope):
            break
        if not said and now() > began + SAID_AFTER and not line.reason.startswith(CANNOT_OPEN):
            said = True
            warn(waiting(gateway))
    return gateway.controller.context.met.is_set()  # what tells where it points is a mount


async def _find(gateway: Gateway, warn: Callable[[str], None]) -> None:
    """Wait for the mount; raise UserError that says what is there instead."""
    if await _found(gateway, warn):
        return
    line, words = gateway.controller.line, not_found(gateway)
    if line.reason.startswith(CANNOT_OPEN):
        raise UserError(f"{gateway.title}: {line.reason}; {_instead(gateway, line.reason)}")
    await line.close()
    from gateway.diagnostics.detect import who_answers

    found = await who_answers(gateway.mount.where, gateway.config.baud)
    if found is None and gateway.config.baud != USUAL and await _answers_at(gateway.mount.where, USUAL):
        raise UserError(
            f"{gateway.title}: the mount answers at {USUAL} baud, and not at {gateway.config.baud}: leave --baud out"
        )
    if found and found != gateway.mount.protocol:
        raise UserError(f"{gateway.title}: the mount speaks {found}; write {found}@{gateway.mount.where}")
    raise UserError(words)


async def _answers_at(where: str, baud: int) -> bool:
    """Whether a mount answers at this rate; asked twice, for it may still make out what came at another one."""
    from gateway.diagnostics.detect import who_answers

    return bool(await who_answers(where, baud) or await who_answers(where, baud))


def _instead(gateway: Gateway, reason: str) -> str:
    """What to do about a mount's port that cannot be opened."""
    if "in use" not in reason:
        return where_else(gateway.mount.where)
    from gateway.diagnostics.detect.ports import holder
    from gateway.system.locks import read_pid

    keeping = gateway.keeping
    if keeping is not None and not keeping.held and (other := read_pid(keeping.lock_path)):
        return (
            f"another mount-gateway (process {other}) has this mount: programs connect to that one; where they "
            "need another --surface, end it and start it with that one, too"
        )
    return f"{holder(gateway.mount.where) or 'it'} has to be ended first"


def waiting(gateway: Gateway) -> str:
    """What is waited for, and how long it may take."""
    spec = PROTOCOLS[gateway.mount.protocol]
    takes = spec.takes[gateway.mount.model is None]
    if gateway.controller.context.met.is_set():
        return (
            f"{gateway.title}: a mount is there, and programs are told where it points; which model it is may take "
            f"it {takes} s to say"
        )
    return f"{gateway.title}: waiting for the mount's first answer; {spec.slowest} may take {takes} s"


def not_found(gateway: Gateway) -> str:
    """Why no mount was found, and what to do; the cable is only doubted where nothing ever came."""
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
