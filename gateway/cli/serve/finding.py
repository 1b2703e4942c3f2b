"""Waits for the mount of a gateway to answer, and explains to the user if it does not.

A message says what was asked, what was received, what that means, and what to do.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from gateway.app.state.mount_claim import MountTaken
from gateway.core.errors import UserError
from gateway.core.wire_log import show
from gateway.protocols.registry import PROTOCOLS
from gateway.system.locks import read_pid

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: Seconds until the first bytes (a hand control's worst case), until the first valid reply once bytes came, and until
#: the mount is identified.
REPLY_WAIT, VALID_WAIT, MODEL_WAIT = 4.0, 10.0, 20.0
#: Seconds from the start until a silent port is given up: some hand controls take 25 s to start.
SEARCH_TIMEOUT = 40.0
#: Seconds after which programs are served by a mount that reports its position but is not identified yet: if the user
#: has named its model, and if not.
NAMED_PORT_WAIT, UNNAMED_PORT_WAIT = 3.0, 4.5
#: The default rate of every mount, baud.
BAUD = 9600
#: With --wait, seconds that the ready lines wait for the identification of the mount.
READY_LINES_WAIT = 0.5
#: Seconds after which a message says what the gateway waits for.
MESSAGE_DELAY = 1.0


async def serve(
    gateway: Gateway,
    waits_for_port: bool,
    longest: float,
    on_ready: Callable[[Gateway], Awaitable[None]],
    warn: Callable[[str], None],
) -> None:
    """Wait for a mount, then call ``on_ready``. Raises UserError if no mount answers within ``longest`` seconds.

    With ``waits_for_port`` it calls ``on_ready`` almost at once, and only warns of a mount that does not answer.
    """
    if not waits_for_port:
        await find(gateway, warn, longest)
    answers = not waits_for_port or await gateway.wait_identified(READY_LINES_WAIT)
    await on_ready(gateway)
    if not answers and not await _found(gateway, warn):
        reason = gateway.controller.line.reason or "no answer"
        at = f" at {gateway.config.baud} baud (mounts talk at {BAUD})" * (gateway.config.baud != BAUD)
        warn(f"{gateway.title}: {reason}{at}; the gateway keeps trying")


async def _found(gateway: Gateway, warn: Callable[[str], None], retry_wait: float | None = None) -> bool:
    """Wait for the mount and return whether it answers; give up if the first bytes or replies do not come in time.

    A port may be silent for `REPLY_WAIT` seconds, or for ``retry_wait`` seconds when the wait is repeated.
    """
    line, now, position = gateway.controller.line, asyncio.get_running_loop().time, gateway.controller.context.found
    began, said, soon = now(), retry_wait is not None, NAMED_PORT_WAIT if gateway.mount.model else UNNAMED_PORT_WAIT
    heard = began if line.transaction.ever_answered else None
    while not (position.is_set() and now() > began + soon):
        if await gateway.wait_identified(0.1):
            return True
        if heard is None and line.transaction.ever_answered:
            heard = now()
        hope = (
            (REPLY_WAIT if retry_wait is None else retry_wait)
            if heard is None
            else MODEL_WAIT
            if line.times.answers
            else VALID_WAIT
        )
        if line.unopened or now() > (heard or began) + hope:
            break
        if not said and now() > began + MESSAGE_DELAY and not line.unopened:
            said = True
            warn(waiting_message(gateway))
    return position.is_set()  # a device that reports a position is a mount


async def find(gateway: Gateway, warn: Callable[[str], None], longest: float = SEARCH_TIMEOUT) -> None:
    """Wait for the mount. Raises UserError if it does not answer; the text describes any other device that does.

    If no byte comes, the user gets a message, the gateway looks once for another kind of mount, and then asks the port
    again until ``longest`` seconds after the start.
    """
    now, line = asyncio.get_running_loop().time, gateway.controller.line
    end = now() + longest
    if await _found(gateway, warn):
        return
    silent = not line.transaction.ever_answered and not _unsupported(gateway.mount.where)
    if not line.unopened:
        if silent and longest:
            warn(not_found_message(gateway, longest))
        await line.close()
        await _check_for_another(gateway)
        if silent and longest:
            line.start()
            if await _found(gateway, warn, end - now()):
                return
    not_found = not_found_message(gateway)
    if line.unopened:
        other = _other_gateway(gateway, line.unopened)
        taken = f"{gateway.title}: {line.unopened}; {_port_advice(gateway, line.unopened, other)}"
        raise MountTaken(taken, f"process {other}") if other else UserError(taken)
    await line.close()
    raise UserError(not_found)


async def _check_for_another(gateway: Gateway) -> None:
    """Look for a mount of another protocol or baud rate on the closed port. Raises UserError if one answers."""
    from gateway.diagnostics.detect.scan_port import who_answers

    protocol = await who_answers(gateway.mount.where, gateway.config.baud)
    if protocol is None and gateway.config.baud != BAUD and await _answers_at(gateway.mount.where, BAUD):
        raise UserError(
            f"{gateway.title}: the mount answers at {BAUD} baud, and not at {gateway.config.baud}: leave --baud out"
        )
    if protocol and protocol != gateway.mount.protocol:
        raise UserError(f"{gateway.title}: the mount speaks {protocol}; write {protocol}@{gateway.mount.where}")


def _unsupported(where: str) -> str:
    from gateway.diagnostics.detect.ports import unsupported_device

    return unsupported_device(where)


async def _answers_at(where: str, baud: int) -> bool:
    """Whether a mount answers at this rate; try twice, because bytes sent at another rate may still disturb it."""
    from gateway.diagnostics.detect.scan_port import who_answers

    return bool(await who_answers(where, baud) or await who_answers(where, baud))


def _other_gateway(gateway: Gateway, reason: str) -> int | None:
    """Return the process ID of another gateway that uses this mount's port; None if no gateway does."""
    if "in use" not in reason or gateway.store is None or gateway.store.held:
        return None
    return read_pid(gateway.store.lock_path)


def _port_advice(gateway: Gateway, reason: str, other: int | None) -> str:
    """Return what to do about a port that cannot be opened; ``other`` is the process ID of the gateway that uses it."""
    if "in use" not in reason:
        return port_advice(gateway.mount.where)
    if other:
        return (
            f"another mount-gateway (process {other}) already drives this mount: connect programs to it. If they "
            f"need another --surface, end it and start it again with both"
        )
    from gateway.diagnostics.detect.ports import gateway_of_another, port_holder

    who = port_holder(gateway.mount.where)
    if not who and (theirs := gateway_of_another()):
        return f"{theirs}: sudo mount-gateway status shows that, and where programs connect"
    return f"end {who or 'it'} first"


def waiting_message(gateway: Gateway) -> str:
    """Return the message that says what the gateway waits for, and how long it may take."""
    spec = PROTOCOLS[gateway.mount.protocol]
    takes = spec.first_answer_seconds[gateway.mount.model is None]
    if gateway.controller.context.found.is_set():
        return f"{gateway.title}: a mount answers, and programs get its position; its model may take some seconds more"
    return f"{gateway.title}: waiting for the mount's first answer; {spec.slowest} may take {takes} s"


def not_found_message(gateway: Gateway, longest: float = 0.0) -> str:
    """Return why no mount was found, and what to do; suspect the cable only if no byte was received.

    With ``longest``, the message says that the gateway continues to ask until that many seconds after its start.
    """
    transaction, where = gateway.controller.line.transaction, gateway.mount.where
    look = f"mount-gateway detect {where} looks closer" if "://" in where else "mount-gateway detect tries every port"
    rest = f"{look}, --wait keeps trying"
    if not transaction.ever_answered and (what := _unsupported(where)):
        return f"{gateway.title}: no mount answers; {what}"
    if not transaction.ever_answered and longest:
        return (
            f"{gateway.title}: no mount answers yet (is it switched on, and the cable in the hand control?); the "
            f"gateway asks for {longest:.0f} s, because some hand controls take 25 s to start; --no-wait "
            "gives up sooner"
        )
    if not transaction.ever_answered:
        return f"{gateway.title}: no mount answers (is it switched on, and the cable in the hand control?); {rest}"
    asked, came = transaction.trouble
    answer = f"it answered {show(came)}" if came else "it did not answer that"
    kind = PROTOCOLS[gateway.mount.protocol].mounts
    return (
        f"{gateway.title}: something answers, but not as a {kind} should. The last question that failed was "
        f"{show(asked)}: {answer}. The cable works; the baud rate or the protocol may be another one; {rest}"
    )


def port_advice(where: str) -> str:
    """Return what to check if a mount's port or address cannot be opened."""
    if where.startswith(("socket://", "rfc2217://")):
        return "is it switched on, in the same network, and is the number of its port right?"
    return "mount-gateway detect shows which ports there are"
