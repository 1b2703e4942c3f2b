"""Identify a mount with the driver and the mount link that the gateway would use for it.

Only commands that this mount has in fact answered are listed as answered, not all that the tables list for its model.
"""

from __future__ import annotations

import asyncio
import statistics
import time
from collections.abc import Iterable
from typing import TypeVar

from msgspec import Struct

from gateway.app.bindings import make_driver
from gateway.app.config import Endpoint, MountConfig
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer
from gateway.core.operations import Values
from gateway.core.wire_log import WireLog, printable
from gateway.diagnostics.detect.port_listener import PortListener
from gateway.mount.link.driver_runner import run_driver
from gateway.mount.link.line import MountLink
from gateway.protocols.base.driver import Driver, Send

#: Timeout of the whole identification, seconds; a mount that answers needs less than two.
IDENTIFY_TIMEOUT = 20.0
#: The timeout of a query that some mounts do not answer: this factor times the longest reply time so far, but at least
#: this many seconds. A telescope that answers in 30 ms does not need the 1.5 s that an unknown device gets.
TIMEOUT_FACTOR, MIN_TIMEOUT = 4.0, 0.6
SITE_QUERY, STATUS_QUERY = "site", "alignment and tracking"
#: The queries to an identified mount: name in the report, operation. None of them moves or changes anything.
QUERIES: tuple[tuple[str, op.Operation[object]], ...] = (
    ("coordinates", op.Position()),
    (STATUS_QUERY, op.GetStatus()),
    (SITE_QUERY, op.GetSite()),
    ("clock", op.GetClock()),
)

_T = TypeVar("_T")


class FoundMount(Struct, frozen=True):
    """An identified mount. ``latency`` is its median reply time, seconds; ``equinox`` is ``jnow`` or ``j2000``, by its
    version; ``aligned`` and ``equatorial`` are None if not reported; ``answered_commands``: empty text for no answer.
    """

    protocol: str
    product: str
    model: str
    version: str
    motor_versions: tuple[str, ...]
    latency: float
    equinox: str
    aligned: bool | None
    equatorial: bool | None
    reports_model: bool
    reports_site: bool
    answered_commands: dict[str, str]  # query -> the commands that were answered


class _Conversation:
    """Carries out a driver's operations on a mount link; records reply times and the commands that were answered."""

    def __init__(self, driver: Driver, link: MountLink) -> None:
        self.driver, self.link = driver, link
        self.reply_times: list[float] = []
        #: The commands that were answered since the list was cleared, in order.
        self.answered_commands: list[str] = []

    async def perform(self, operation: op.Operation[_T]) -> _T:
        """Return the operation's answer. Raises Fault if the mount does not answer, or cannot do it."""
        return await run_driver(self.driver.perform(operation), self._exchange, lambda later: None)

    async def _exchange(self, send: Send) -> Values:
        if send.timeout is not None and self.reply_times:
            send = send._replace(timeout=min(send.timeout, max(MIN_TIMEOUT, TIMEOUT_FACTOR * max(self.reply_times))))
        answer = await self.link.exchange(send)
        if self.driver.protocol.commands[send.command].replies:
            self.reply_times.append(self.link.transaction.times.last_rtt)
            self.answered_commands.append(send.command)
        return answer


async def identify(
    protocol: str, listener: PortListener, model: str | None = None, version: str | None = None
) -> FoundMount:
    """Let the protocol's driver identify the mount on an open port. Raises Fault if it cannot."""
    now = asyncio.get_running_loop().time
    driver, _, reply_rules = make_driver(Endpoint(protocol, listener.name, model, version), MountConfig(at="-"), now)
    line = MountLink(listener, reply_rules, WireLog(time.time))
    talk = _Conversation(driver, line)
    line.start()
    try:
        async with asyncio.timeout(IDENTIFY_TIMEOUT):
            identity: op.Identity = await talk.perform(op.GetIdentity())
            answers: dict[str, str] = {}
            fields: dict[str, object] = {}
            for name, operation in QUERIES:
                talk.answered_commands.clear()
                fields[name] = await _answer_or_none(talk, operation)
                answers[name] = _format_commands(driver, talk.answered_commands) if fields[name] is not None else ""
            await _answer_or_none(talk, op.Position())  # once more, for the usual time of an answer
    except TimeoutError:
        raise NoAnswer from None
    finally:
        await line.close()
    status = fields[STATUS_QUERY]
    return FoundMount(
        protocol=protocol,
        product=identity.product,
        model=identity.model,
        version=identity.version,
        motor_versions=identity.motors,
        latency=statistics.median(talk.reply_times),
        equinox=driver.equinox,
        aligned=status.aligned if isinstance(status, op.Status) else None,
        equatorial=status.equatorial if isinstance(status, op.Status) else None,
        reports_model=identity.model in driver.protocol.models,
        reports_site=driver.gps or bool(answers[SITE_QUERY]),
        answered_commands=answers,
    )


async def _answer_or_none(conversation: _Conversation, operation: op.Operation[_T]) -> _T | None:
    """Return the answer, or None if the mount cannot give it."""
    try:
        return await conversation.perform(operation)
    except Fault:
        return None


def _format_commands(driver: Driver, command_names: Iterable[str]) -> str:
    """Format commands as in the manual, without arguments; a command that is not printable appears by its name."""
    written = {name: printable(driver.protocol.commands[name].request.prefix) for name in command_names}
    return " ".join(dict.fromkeys(name if "\\" in text else text for name, text in written.items()))
