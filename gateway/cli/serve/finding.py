"""Waits for the mount of a gateway to answer, and explains to the user if it does not.

A message says what was asked, what was received, what that means, and what to do.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from gateway.app.state.mount_claim import MountTaken
from gateway.core.errors import UserError
from gateway.core.wire_log import printable
from gateway.protocols.registry import PROTOCOLS
from gateway.system.locks import read_pid

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: Timeouts in seconds: for the first bytes (a slow hand control needs so long); after these, for a valid reply and for
#: the identification of the mount.
REPLY_WAIT, VALID_REPLY_WAIT, MODEL_WAIT = 4.0, 10.0, 20.0
#: Seconds from the start until a silent port is given up: some hand controls take 25 s to start.
SEARCH_TIMEOUT = 40.0
#: Seconds after which programs may use a mount that reports its position but is not identified yet. The first is for
#: a mount whose model the user has named, the second for any other.
NAMED_MODEL_WAIT, UNNAMED_MODEL_WAIT = 3.0, 4.5
#: The default rate of every mount, baud.
BAUD = 9600
#: With --wait, seconds to wait for the identification of the mount before the ``ready`` lines are printed.
READY_LINES_WAIT = 0.5
#: Seconds after which a message says what the gateway waits for.
WAITING_MESSAGE_DELAY = 1.0


async def make_ready(
    gateway: Gateway,
    waits_for_port: bool,
    search_timeout: float,
    on_ready: Callable[[Gateway], Awaitable[None]],
    warn: Callable[[str], None],
) -> None:
    """Wait for a mount, then call ``on_ready``. Raises UserError if none answers; see ``find_mount`` for the timeout.

    With ``waits_for_port`` it calls ``on_ready`` within 0.5 s, and only warns of a mount that does not answer.
    """
    if not waits_for_port:
        await find_mount(gateway, warn, search_timeout)
    answers = not waits_for_port or await gateway.wait_identified(READY_LINES_WAIT)
    await on_ready(gateway)
    if not answers and not await _wait_for_mount(gateway, warn):
        reason = gateway.controller.line.down_cause or "no answer"
        at = f" at {gateway.config.baud} baud (mounts talk at {BAUD})" * (gateway.config.baud != BAUD)
        warn(f"{gateway.title}: {reason}{at}; the gateway keeps trying")


async def _wait_for_mount(gateway: Gateway, warn: Callable[[str], None], retry_wait: float | None = None) -> bool:
    """Wait for the mount; return whether it reports a position or its model. Give up after a timeout or an open error.

    A port may be silent for `REPLY_WAIT` seconds, or for ``retry_wait`` seconds when the wait is repeated.
    """
    line, now, position = gateway.controller.line, asyncio.get_running_loop().time, gateway.controller.context.replied
    began, said, soon = now(), retry_wait is not None, NAMED_MODEL_WAIT if gateway.mount.model else UNNAMED_MODEL_WAIT
    heard = began if line.transaction.ever_answered else None
    while not (position.is_set() and now() > began + soon):
        if await gateway.wait_identified(0.1):
            return True
        if heard is None and line.transaction.ever_answered:
            heard = now()
        timeout = (
            (REPLY_WAIT if retry_wait is None else retry_wait)
            if heard is None
            else MODEL_WAIT
            if line.times.reply_count
            else VALID_REPLY_WAIT
        )
        if line.open_error or now() > (heard or began) + timeout:
            break
        if not said and now() > began + WAITING_MESSAGE_DELAY and not line.open_error:
            said = True
            warn(waiting_message(gateway))
    return position.is_set()  # a device that reports a position is a mount


async def find_mount(gateway: Gateway, warn: Callable[[str], None], search_timeout: float = SEARCH_TIMEOUT) -> None:
    """Wait for the mount. Raises UserError if it does not answer; the error names any other device that answers.

    If no byte comes, the gateway warns, looks once for another kind of mount, and asks again until ``search_timeout``
    seconds after the start (0.0: not again). Raises MountTaken if another gateway uses the port.
    """
    now, line = asyncio.get_running_loop().time, gateway.controller.line
    end = now() + search_timeout
    if await _wait_for_mount(gateway, warn):
        return
    silent = not line.transaction.ever_answered and not _unsupported_message(gateway.mount.where)
    if not line.open_error:
        if silent and search_timeout:
            warn(not_found_message(gateway, search_timeout))
        await line.close()
        await _check_other_protocols(gateway)
        if silent and search_timeout:
            line.start()
            if await _wait_for_mount(gateway, warn, end - now()):
                return
    not_found = not_found_message(gateway)
    if line.open_error:
        other = _other_gateway_pid(gateway, line.open_error)
        taken = f"{gateway.title}: {line.open_error}; {_open_error_advice(gateway, line.open_error, other)}"
        raise MountTaken(taken, f"process {other}") if other else UserError(taken)
    await line.close()
    raise UserError(not_found)


async def _check_other_protocols(gateway: Gateway) -> None:
    """Look for a mount of another protocol or baud rate on the closed port. Raises UserError if one answers."""
    from gateway.diagnostics.detect.scan_port import answering_protocol

    protocol = await answering_protocol(gateway.mount.where, gateway.config.baud)
    if protocol is None and gateway.config.baud != BAUD and await _answers_at(gateway.mount.where, BAUD):
        raise UserError(
            f"{gateway.title}: the mount answers at {BAUD} baud, and not at {gateway.config.baud}: leave --baud out"
        )
    if protocol and protocol != gateway.mount.protocol:
        raise UserError(f"{gateway.title}: the mount speaks {protocol}; write {protocol}@{gateway.mount.where}")


def _unsupported_message(where: str) -> str:
    from gateway.diagnostics.detect.ports import unsupported_device_at

    return unsupported_device_at(where)


async def _answers_at(where: str, baud: int) -> bool:
    """Whether a mount answers at this rate; try twice, because bytes sent at another rate may still disturb it."""
    from gateway.diagnostics.detect.scan_port import answering_protocol

    return bool(await answering_protocol(where, baud) or await answering_protocol(where, baud))


def _other_gateway_pid(gateway: Gateway, open_error: str) -> int | None:
    """Return the process ID of another gateway that uses this mount's port; None if no gateway does."""
    if "in use" not in open_error or gateway.store is None or gateway.store.has_lock:
        return None
    return read_pid(gateway.store.lock_path)


def _open_error_advice(gateway: Gateway, error: str, pid: int | None) -> str:
    """Return what to do about a port that cannot be opened; ``pid`` is the process ID of the gateway that uses it."""
    if "in use" not in error:
        return port_advice(gateway.mount.where)
    if pid:
        return (
            f"another mount-gateway (process {pid}) already drives this mount: connect programs to it. If they "
            f"need another --surface, end it and start it again with both"
        )
    from gateway.diagnostics.detect.ports import other_user_gateway, port_holder

    who = port_holder(gateway.mount.where)
    if not who and (theirs := other_user_gateway()):
        return f"{theirs}: sudo mount-gateway status shows that, and where programs connect"
    return f"end {who or 'it'} first"


def waiting_message(gateway: Gateway) -> str:
    """Return the message that says what the gateway waits for, and how long it may take."""
    spec = PROTOCOLS[gateway.mount.protocol]
    takes = spec.first_answer_seconds[gateway.mount.model is None]
    if gateway.controller.context.replied.is_set():
        return f"{gateway.title}: a mount answers, and programs get its position; its model may take some seconds more"
    return f"{gateway.title}: waiting for the mount's first answer; {spec.slowest_mount} may take {takes} s"


def not_found_message(gateway: Gateway, search_timeout: float = 0.0) -> str:
    """Return why no mount was found, and what to do; suspect the cable only if no byte was received.

    With ``search_timeout``, the message says that the gateway continues to ask until that many seconds after its start.
    """
    transaction, where = gateway.controller.line.transaction, gateway.mount.where
    look = f"mount-gateway detect {where} looks closer" if "://" in where else "mount-gateway detect tries every port"
    advice = f"{look}, --wait keeps trying"
    if not transaction.ever_answered and (what := _unsupported_message(where)):
        return f"{gateway.title}: no mount answers; {what}"
    if not transaction.ever_answered and search_timeout:
        return (
            f"{gateway.title}: no mount answers yet (is it switched on, and the cable in the hand control?); the "
            f"gateway asks for {search_timeout:.0f} s, because some hand controls take 25 s to start; --no-wait "
            "gives up sooner"
        )
    if not transaction.ever_answered:
        return f"{gateway.title}: no mount answers (is it switched on, and the cable in the hand control?); {advice}"
    asked, came = transaction.last_failed_exchange
    answer = f"it answered {printable(came)}" if came else "it did not answer that"
    kind = PROTOCOLS[gateway.mount.protocol].mounts_phrase
    return (
        f"{gateway.title}: something answers, but not as a {kind} should. The last question that failed was "
        f"{printable(asked)}: {answer}. The cable works; the baud rate or the protocol may be another one; {advice}"
    )


def port_advice(where: str) -> str:
    """Return what to check if a mount's port or address cannot be opened."""
    if where.startswith(("socket://", "rfc2217://")):
        return "is it switched on, in the same network, and is the number of its port right?"
    return "mount-gateway detect shows which ports there are"
