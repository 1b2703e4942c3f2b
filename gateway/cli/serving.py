"""Serving until a signal comes: the event loop, the signals, and a gateway from its ports to its mount."""

from __future__ import annotations

import asyncio
import signal
import sys
import time
from collections.abc import Awaitable, Callable
from typing import Any

from gateway.config import Config, parse_endpoint
from gateway.errors import UserError

#: How long a mount may take to say its first word (a hand control's worst), and to say all that it is asked.
FIRST_WORD, FIND_MOUNT = 4.0, 20.0
#: With --wait, how long the ready lines wait for the mount to say what fits it.
QUICK = 0.5



def with_loop(fast: bool, serve: Callable[[], Awaitable[int]]) -> int:
    """Run on uvloop where it is installed, else on asyncio's own loop."""
    factory: Callable[[], asyncio.AbstractEventLoop] | None = None
    if fast:
        try:
            import uvloop

            factory = uvloop.new_event_loop
        except ImportError:
            factory = None
    with asyncio.Runner(loop_factory=factory) as runner:
        return runner.run(serve())  # type: ignore[arg-type]


def until_signal() -> asyncio.Event:
    """An event that SIGINT and SIGTERM set."""
    done = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, done.set)
        except NotImplementedError:  # Windows
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(done.set))
    return done


async def serve_gateway(config: Config) -> int:
    from gateway.assembly import Gateway
    from gateway.transcript import Transcript

    done = until_signal()
    transcript = Transcript(time.time)
    if config.log:
        from gateway.logline import printer

        transcript.sinks.append(printer(parse_endpoint(config.mount.at).protocol, sys.stderr))
    gateway = Gateway(config, transcript)
    await gateway.open()
    try:
        if not config.wait:
            await _find(gateway, done)
        gateway.sky.start()
        found = not config.wait or await gateway.found(QUICK)
        for name in gateway.names():
            print(f"ready {name}", flush=True)
        if not found and not await gateway.found(FIRST_WORD) and not done.is_set():
            assert gateway.hub is not None
            reason = gateway.hub.line.reason or "no answer"
            print(f"mount-gateway: {gateway.mount}: {reason}; trying on", file=sys.stderr, flush=True)
        await done.wait()
    finally:
        await gateway.close()
    return 0


async def _find(gateway: Any, done: asyncio.Event) -> None:
    """Wait for the mount; raise UserError that says what is there instead."""
    hub, now = gateway.hub, asyncio.get_running_loop().time
    began = now()
    while now() < began + FIND_MOUNT and not done.is_set():
        if await gateway.found(0.1):
            return
        if hub.line.state == "down" or (hub.line.answers == 0 and now() > began + FIRST_WORD):
            break
    if done.is_set() or gateway.fitted.is_set():
        return
    reason = hub.line.reason
    if reason.startswith("cannot open"):
        raise UserError(f"{gateway.mount}: {reason}")
    await hub.line.close()
    from gateway.probe import who_answers

    found = await who_answers(gateway.mount.where, gateway.config.mount.baud)
    if found and found != gateway.mount.protocol:
        raise UserError(f"{gateway.mount}: the mount speaks {found}; write {found}@{gateway.mount.where}")
    raise UserError(f"{gateway.mount}: no mount answers (is it switched on, and the cable in the hand control?); "
                    "--wait keeps trying")
