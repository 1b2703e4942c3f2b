"""Serving until a signal comes: the event loop, the signals, and one gateway per mount from its ports to its mount.

One mount that does not answer ends the program, with the reason. Of several, one that does not answer is told of and
waited for while the others work; only when none answers does the program end.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from gateway import __version__
from gateway.config import Config, parse_endpoint
from gateway.errors import UserError
from gateway.transcript import SKY_READY

if TYPE_CHECKING:
    from gateway.assembly import Gateway
    from gateway.recording import Recorder

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


async def serve_mounts(config: Config, banner: str = "") -> int:
    """Serve every mount until a signal comes -> the exit code. ``banner`` is said once the ports are open.

    Raises UserError for a port that cannot be opened, and when no mount is found.
    """
    from gateway.assembly import Gateway
    from gateway.sky import Sky
    from gateway.transcript import Transcript

    done, sky = until_signal(), Sky()
    gateways: list[Gateway] = []
    for mount in config.mount:
        transcript = Transcript(time.time)
        if config.log:
            from gateway.logline import printer

            transcript.sinks.append(printer(parse_endpoint(mount.at).protocol, sys.stderr, mount.name))
        gateways.append(Gateway(mount, config.of(mount), transcript, sky))
        if mount.record:
            transcript.sinks.append(_recorder(mount.record, gateways[-1]).put)
    try:
        for gateway in gateways:
            await gateway.open()
        if banner:
            print(banner, flush=True)
        serving = asyncio.gather(*(_serve(gateway, config, done) for gateway in gateways))
        await _unless(done, serving)
        await done.wait()
    finally:
        await asyncio.gather(*(gateway.close() for gateway in gateways))
    return 0


def _recorder(path: str, gateway: Gateway) -> Recorder:
    import msgspec

    from gateway.recording import Recorder

    config = {"mount": gateway.config, "surface": gateway.surfaces}
    settings = {"began": time.time(), "config": msgspec.to_builtins(config), "version": __version__}
    return Recorder(Path(path), asyncio.get_running_loop().time, settings)


def _from_the_thread(work: Callable[[], object]) -> Callable[[], None]:
    """What another thread may call to have something done on this one, as long as there is a loop."""
    loop = asyncio.get_running_loop()

    def call() -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: nobody wants to know
            loop.call_soon_threadsafe(work)

    return call


async def _unless(done: asyncio.Event, work: asyncio.Future[list[UserError | None]]) -> None:
    """Wait for the mounts to be found, or for a signal. Raises UserError when every one of them is missing."""
    waiting = asyncio.ensure_future(done.wait())
    await asyncio.wait(cast("list[asyncio.Future[Any]]", [waiting, work]), return_when=asyncio.FIRST_COMPLETED)
    waiting.cancel()
    if not work.done():
        work.cancel()
        await asyncio.gather(work, return_exceptions=True)
        return
    missing = work.result()
    if all(missing) and not done.is_set():
        raise missing[0]  # type: ignore[misc]


async def _serve(gateway: Gateway, config: Config, done: asyncio.Event) -> UserError | None:
    """Find one mount and say that it is ready -> why it was not found, where that is no reason to wait for it."""
    reason = None if config.wait else await _find(gateway, alone=len(config.mount) == 1)
    if reason is not None and len(config.mount) == 1:
        return reason
    gateway.sky.start(_from_the_thread(lambda: gateway.transcript.note("mount", SKY_READY)))
    found = reason is None and (not config.wait or await gateway.found(QUICK))
    for name in gateway.names():
        print(f"ready {name}", flush=True)
    if reason is not None:
        print(f"mount-gateway: {reason}; trying on", file=sys.stderr, flush=True)
    elif not found and not await gateway.found(FIRST_WORD) and not done.is_set():
        assert gateway.hub is not None
        words = gateway.hub.line.reason or "no answer"
        print(f"mount-gateway: {gateway.title}: {words}; trying on", file=sys.stderr, flush=True)
    return reason


async def _find(gateway: Gateway, *, alone: bool) -> UserError | None:
    """Wait for the mount -> what is there instead. Only the line of one that is ``alone`` may be asked who it is."""
    assert gateway.hub is not None
    line, now = gateway.hub.line, asyncio.get_running_loop().time
    began = now()
    while now() < began + FIND_MOUNT:
        if await gateway.found(0.1):
            return None
        if line.state == "down" or (line.answers == 0 and now() > began + FIRST_WORD):
            break
    if line.reason.startswith("cannot open"):
        return UserError(f"{gateway.title}: {line.reason}")
    if alone:
        await line.close()
        from gateway.probe import who_answers

        found = await who_answers(gateway.mount.where, gateway.config.baud)
        if found and found != gateway.mount.protocol:
            return UserError(f"{gateway.title}: the mount speaks {found}; write {found}@{gateway.mount.where}")
    return UserError(f"{gateway.title}: no mount answers (is it switched on, and the cable in the hand control?)"
                     + ("; --wait keeps trying" if alone else ""))
