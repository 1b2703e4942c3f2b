"""Carries out the orders ``stop``, ``hold`` and ``release`` of ``mount-gateway stop``.

The answer is ``stopped``, ``held`` or ``released`` only if that was verified. Every other answer is ``failed`` with the
reason, in words for the user of the command.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

from gateway.app.control.server import Order
from gateway.app.recording.entrance import Entrance
from gateway.app.state import file as on_disk
from gateway.app.state.store import StateStore
from gateway.core.errors import Fault, told
from gateway.mount.controller import MountController
from gateway.mount.readings.rest import TIME_TO_REST, come_to_rest

STOPPED, HELD, RELEASED = "stopped", "held", "released"
#: What people read instead of an answer.
IN_WORDS = {HELD: "stopped and held"}
#: Seconds within which a mount must acknowledge a stop; a hand control takes at most 3.5 for one reply.
ACKNOWLEDGED = 5.0
#: Seconds for which the command waits for the answer.
LONGEST = ACKNOWLEDGED + TIME_TO_REST + 2.0


def orders(controller: MountController, store: StateStore, entrance: Entrance = Entrance()) -> Mapping[str, Order]:
    """Return the orders by their words."""

    async def stop() -> str:
        return await entrance.carry_out("o", lambda: stopped(controller))

    async def hold() -> str:
        entrance.apply_event("h", lambda: _hold(controller, True))
        answer, trouble = await asyncio.gather(
            entrance.carry_out("o", lambda: stopped(controller)), _on_disk(store, held=True)
        )
        if answer != STOPPED:
            return f"failed not stopped: {answer.removeprefix('failed ')}; it is held from now on{trouble}"
        return f"failed it is stopped and held{trouble}" if trouble else HELD

    async def release() -> str:
        trouble = await _on_disk(store, held=False)
        entrance.apply_event("u", lambda: _hold(controller, False))
        return f"failed it is released{trouble}" if trouble else RELEASED

    return {"stop": stop, "hold": hold, "release": release}


def _hold(controller: MountController, on: bool) -> None:
    controller.hold.on = on


async def stopped(controller: MountController) -> str:
    """Stop the mount and watch it until it is at rest; return ``stopped`` or ``failed REASON``."""
    try:
        async with asyncio.timeout(ACKNOWLEDGED):
            await controller.stop("mount-gateway stop")
    except (TimeoutError, Fault) as fault:
        if controller.driver.asleep and controller.line.state != "down":
            return STOPPED  # a hibernating mount is at rest, and does not answer
        why = controller.line.reason or str(fault) or f"no answer from the mount within {ACKNOWLEDGED:.0f} s"
        owed = "; the stop is owed, and the first thing that it is sent when it answers again" * controller.wanted.owed
        return f"failed {why}{owed}"
    try:
        await come_to_rest(controller.context, controller.reader)
    except Fault as fault:
        return f"failed {fault}"
    return STOPPED


async def _on_disk(store: StateStore, *, held: bool) -> str:
    """Write or remove the hold file; return an empty text, or what went wrong as the rest of a sentence."""
    try:
        async with asyncio.timeout(ACKNOWLEDGED):
            await store.in_thread(on_disk.hold_folder if held else on_disk.release_folder, store.directory)
    except OSError as error:  # TimeoutError, for a disk that hangs, is an OSError too
        where = store.directory / on_disk.HOLD
        why = told(error) if error.strerror else "the disk does not answer"
        if held:
            return f", but a restart of the gateway forgets that: {where} cannot be written ({why})"
        return f", but a restart of the gateway holds it again: {where} cannot be removed ({why})"
    return ""
