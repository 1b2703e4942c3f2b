"""Shutdown: ends all motion, and resumes tracking if it was on before the motion.

The stop is sent, and its acknowledgement awaited. If none comes, or the worker of the line has ended, the bytes of the
stop are written without waiting. Then pending follow-ups are awaited, because some hand controls need the tracking
command twice.
"""

from __future__ import annotations

import asyncio
import contextlib
import copy

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.mount.context import Context
from gateway.mount.motion import changes
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.readings.reader import Reader
from gateway.protocols.base.driver import Driver, Send
from gateway.protocols.base.reply_rules import ReplyRules

#: Seconds to wait for the stop and for the follow-up commands, and between commands sent without awaiting replies.
STOP_TIMEOUT, FOLLOW_UP_TIMEOUT, BLIND_COMMAND_GAP = 4.0, 2.5, 0.2
#: Seconds for the last status read, which the gateway reports when it ends.
LAST_READ_TIMEOUT = 1.0


async def end_motion(context: Context, reader: Reader, reconciler: Reconciler) -> None:
    """Stop all motion and resume tracking; takes a few seconds at most, and raises nothing."""
    link = context.link
    reconciler.update(changes.refuse_earlier_orders(reconciler.wanted))
    was_busy = reconciler.busy and link.state != "opening"
    if was_busy:
        await _stop(context, reconciler)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(FOLLOW_UP_TIMEOUT):
            while link.usable and reconciler.wanted.pending:  # some hand controls need the tracking command twice
                await asyncio.sleep(0.05)
    if was_busy and not reconciler.wanted.stop_owed and link.state == "up":
        with contextlib.suppress(TimeoutError, Fault):
            async with asyncio.timeout(LAST_READ_TIMEOUT):
                await reader.read_now(op.GetStatus())


async def _stop(context: Context, reconciler: Reconciler) -> None:
    await asyncio.sleep(0)  # if the event loop is being torn down, the line's task is cancelled as well
    try:
        async with asyncio.timeout(STOP_TIMEOUT if context.link.is_running else 0.0):
            await reconciler.stop()
    except (TimeoutError, Fault):
        context.note("the mount did not acknowledge the stop at shutdown: sending it once more")
        await _stop_blindly(context)


async def _stop_blindly(context: Context) -> None:
    """Write the bytes of a stop without waiting for replies."""
    with contextlib.suppress(Exception):  # nothing is left to try after this
        for command in stop_commands(context.driver, context.link.reply_rules):
            context.link.transaction.send(command)
            await asyncio.sleep(BLIND_COMMAND_GAP)


def stop_commands(driver: Driver, reply_rules: ReplyRules, without_restores: bool = False) -> list[bytes]:
    """Return the commands of a stop in the driver's present state, for callers that cannot wait for replies.

    The driver's state does not change. ``without_restores`` leaves out settings that are restored after the motion:
    the mount may have been switched off meanwhile.
    """
    twin = copy.copy(driver)
    for name, value in vars(driver).items():
        if isinstance(value, dict | set):
            setattr(twin, name, value.copy())
    steps, commands = twin.perform(op.AbortMotion()), []
    with contextlib.suppress(Exception):  # StopIteration at the end, or an error if the driver needs a reply
        step = next(steps)
        while True:
            if isinstance(step, Send) and not (without_restores and step.command not in driver.ending_commands):
                commands.append(reply_rules.encode(step))
            step = steps.send({})
    return commands
