"""Shutdown: nothing moves afterwards, and the mount tracks as its user had it.

The stop is sent and waited for. If no answer comes, or nothing serves the line any more, its bytes are sent all the
same. Then what survives a stop is waited for: a hand control may have to be told twice to track again.
"""

from __future__ import annotations

import asyncio
import contextlib
import copy

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.mount.context import Context
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.readings.reader import Reader
from gateway.protocols.base.driver import Driver, Send
from gateway.protocols.base.reply_rules import ReplyRules

#: Seconds for the stop, and for what must follow it; between two commands whose answers nobody waits for.
STOP, SETTLE, BLIND = 4.0, 2.5, 0.2
#: Seconds in which the mount may tell how it was left, for whoever ended the gateway to read.
LEFT = 1.0


async def end_motion(context: Context, reader: Reader, reconciler: Reconciler) -> None:
    """Stop whatever moves and put tracking back; takes seconds at most, and raises nothing."""
    link = context.link
    reconciler.no_more()  # what still waits in a connection is not begun any more
    moved = reconciler.busy and link.state != "opening"
    if moved:
        await _stop(context, reconciler)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(SETTLE):
            while link.usable and reconciler.wanted.pending:  # hand controls may need to be told twice to track again
                await asyncio.sleep(0.05)
    if moved and not reconciler.wanted.owed and link.state == "up":
        with contextlib.suppress(TimeoutError, Fault):
            async with asyncio.timeout(LEFT):
                await reader.anew(op.GetStatus())


async def _stop(context: Context, reconciler: Reconciler) -> None:
    await asyncio.sleep(0)  # a loop that is torn down has cancelled the line as well
    try:
        async with asyncio.timeout(STOP if context.link.served else 0.0):
            await reconciler.stop()
    except (TimeoutError, Fault):
        context.note("the mount did not answer the stop at shutdown: the stop is sent once more")
        await _stop_blindly(context)


async def _stop_blindly(context: Context) -> None:
    """The bytes of a stop, without waiting for answers."""
    with contextlib.suppress(Exception):  # the last thing tried
        for command in stop_commands(context.driver, context.link.dialogue):
            context.link.talk.send(command)
            await asyncio.sleep(BLIND)


def stop_commands(driver: Driver, dialogue: ReplyRules, ends_only: bool = False) -> list[bytes]:
    """The bytes of a stop as things are now, for whoever cannot wait for answers; the driver itself learns nothing.

    With ``ends_only`` without what is put back after the motion: perhaps the mount was switched off meanwhile.
    """
    twin = copy.copy(driver)
    for name, value in vars(driver).items():
        if isinstance(value, dict | set):
            setattr(twin, name, value.copy())
    steps, commands = twin.perform(op.AbortMotion()), []
    with contextlib.suppress(Exception):  # it ends with StopIteration, or where an answer would be needed to go on
        step = next(steps)
        while True:
            if isinstance(step, Send) and not (ends_only and step.command not in driver.ends):
                commands.append(dialogue.encode(step))
            step = steps.send({})
    return commands
