"""Carries out the requests ``StopRequest``, ``HoldRequest`` and ``ReleaseHoldRequest``.

A stop or a hold is reported as done only if the mount was seen at rest, or is asleep. Else the answer says what failed.
"""

from __future__ import annotations

import asyncio

from gateway.app.state import file as on_disk
from gateway.app.state.store import StateStore
from gateway.core.errors import Fault, explain_os_error
from gateway.core.requests import DONE, FAILED, Answer, HoldRequest, ReleaseHoldRequest, StopOrHold
from gateway.mount.controller import MountController
from gateway.mount.readings.rest import MAX_TIME_TO_REST, wait_for_rest

#: The client's name in the log and in messages that say who stopped the mount.
STOP_CLIENT = "mount-gateway stop"
STOPPED_ANSWER = Answer(DONE, "stopped")
#: Seconds within which a mount must acknowledge a stop; a hand control takes at most 3.5 for one reply.
STOP_ACK_TIMEOUT = 5.0
#: Seconds for which ``mount-gateway stop`` waits for the answer of the gateway.
STOP_TIMEOUT = STOP_ACK_TIMEOUT + MAX_TIME_TO_REST + 2.0


async def carry_out_stop(request: StopOrHold, controller: MountController, store: StateStore) -> Answer:
    """Stop, hold or release the mount, as requested; return the answer, which is also logged."""
    who = request.who or STOP_CLIENT
    answer = await _execute(request, who, controller, store)
    controller.wire_log.put(who, "*", note=f"{str(request.__struct_config__.tag).capitalize()}: {answer.text}")
    return answer


async def _execute(request: StopOrHold, client_name: str, controller: MountController, store: StateStore) -> Answer:
    if isinstance(request, ReleaseHoldRequest):
        trouble = await _update_hold_file(store, hold=False)
        controller.hold.is_on = False
        return Answer(FAILED, f"it is released{trouble}") if trouble else Answer(DONE, "released")
    if not isinstance(request, HoldRequest):
        return await stop_mount(controller, client_name)
    controller.hold.is_on = True
    answer, trouble = await asyncio.gather(stop_mount(controller, client_name), _update_hold_file(store, hold=True))
    if not answer.is_ok:
        return Answer(FAILED, f"not stopped: {answer.text}; it is held from now on{trouble}")
    return Answer(FAILED, f"it is stopped and held{trouble}") if trouble else Answer(DONE, "stopped and held")


async def stop_mount(controller: MountController, client_name: str = STOP_CLIENT) -> Answer:
    """Stop the mount for a client, and watch it until it is at rest. A failed answer gives the reason."""
    try:
        async with asyncio.timeout(STOP_ACK_TIMEOUT):
            await controller.stop(client_name)
    except (TimeoutError, Fault) as fault:
        if controller.driver.asleep and controller.line.state != "down":
            return STOPPED_ANSWER  # a hibernating mount is at rest, and does not answer
        why = controller.line.down_cause or str(fault) or f"no answer from the mount within {STOP_ACK_TIMEOUT:.0f} s"
        owed = "; the gateway sends the stop first as soon as the mount answers again" * controller.wanted.stop_owed
        return Answer(FAILED, f"{why}{owed}")
    try:
        await wait_for_rest(controller.context, controller.reader)
    except Fault as fault:
        return Answer(FAILED, str(fault))
    return STOPPED_ANSWER


async def _update_hold_file(store: StateStore, *, hold: bool) -> str:
    """Write or remove the hold file; return an empty text, or what went wrong as the rest of a sentence."""
    try:
        async with asyncio.timeout(STOP_ACK_TIMEOUT):
            await store.in_thread(on_disk.write_hold_file if hold else on_disk.delete_hold_file, store.folder)
    except OSError as error:  # TimeoutError, for a disk that hangs, is an OSError too
        where = store.folder / on_disk.HOLD_FILE
        why = explain_os_error(error) if error.strerror else "the disk does not answer"
        if hold:
            return f", but a restart of the gateway forgets that: {where} cannot be written ({why})"
        return f", but a restart of the gateway holds it again: {where} cannot be removed ({why})"
    return ""
