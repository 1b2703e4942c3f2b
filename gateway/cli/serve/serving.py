"""Runs one gateway per mount on one event loop, until a signal ends the process.

If a mount does not answer, the program ends and says why. With several mounts, or with --wait, a warning is printed and
the gateway keeps trying; the other mounts are unaffected.
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Callable, Coroutine, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.app.config import Config, MountConfig, SurfaceConfig, parse_endpoint
from gateway.astro.ephemeris.keeper import AlmanacKeeper
from gateway.astro.ephemeris.sky import Sky
from gateway.cli.serve.console_and_broker import (
    broker_access,
    console_offers,
    http_offers,
    http_surfaces,
    load_console,
    open_broker,
    open_console,
)
from gateway.cli.serve.finding import SEARCH_TIMEOUT, make_ready
from gateway.cli.serve.live import Screen, find_terminal, start_status_updates
from gateway.cli.serve.signals import call_before_suspension, end_signal_event, race
from gateway.core.errors import Fault
from gateway.core.wire_log import Sink, WireLog
from gateway.diagnostics.log import as_json
from gateway.system import garbage
from gateway.system.file_limits import raise_file_limit
from gateway.system.short_slices import ask_for_short_slices
from gateway.system.systemd import notify
from gateway.transport.web_server import WebServer

if TYPE_CHECKING:
    from typing import TypeAlias

    from gateway.app.discovery.offer import Offer
    from gateway.app.discovery.served import PhoneInstructions
    from gateway.app.gateway import Gateway
    from gateway.app.recording.recorder import Recorder
    from gateway.app.watchdog.client import Watchdog

    #: A coroutine function of this process that uses a gateway's mount for a while, such as the check of ``prove``.
    GatewayJob: TypeAlias = Callable[[Gateway], Coroutine[object, object, None]]

#: Seconds to wait for the site and clock of a mount that was found, before the ``ready`` lines are printed.
SITE_AND_CLOCK_WAIT = 3.0
#: Seconds between two checks of this computer's network addresses.
ADDRESS_CHECK_PERIOD = 3.0
#: Timeout in seconds for a stop before the process is suspended.
SUSPEND_TIMEOUT = 4.0


def run_on_loop(uses_uvloop: bool, serve: Callable[[], Coroutine[object, object, int]]) -> int:
    """Run ``serve`` on uvloop if ``uses_uvloop`` and it is installed, else on asyncio's loop; return its exit code."""
    factory: Callable[[], asyncio.AbstractEventLoop] | None = None
    if uses_uvloop:
        with suppress(ImportError):
            import uvloop

            factory = uvloop.new_event_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        return runner.run(serve())


def make_watchdog(config: Config) -> Watchdog | None:
    """Return the watchdog, whose process is not started yet; None if it is turned off, not needed or not possible."""
    from gateway.app.watchdog.client import Watchdog, is_available

    real = any(parse_endpoint(mount.at).where != "sim" for mount in config.mount)
    return Watchdog() if config.watchdog and real and is_available() else None


async def serve_mounts(
    config: Config,
    banner: str = "",
    watchdog: Watchdog | None = None,
    job: GatewayJob | None = None,
    screen: Screen | None = None,
) -> int:
    """Serve every mount until a signal comes; return the exit code. ``banner`` is printed once the ports are open.

    ``job`` (the check of ``prove``) runs with the first mount once that is ready, and all gateways end with it; it
    prints on ``screen``. Raises UserError if a port cannot be opened, or if no mount is found.
    """
    from gateway.app.discovery.answering import DiscoveryAnswers
    from gateway.app.discovery.offer import network_offers
    from gateway.app.discovery.served import PhoneInstructions
    from gateway.app.gateway import Gateway

    access = broker_access(config)
    done, sky = end_signal_event(), Sky()
    # no status line together with the output of --log, which would be disturbed by it
    terminal = find_terminal() if config.status and not config.log else None
    screen = screen or Screen(terminal, config.night, as_json.selects_json(config.log))
    if watchdog is not None:
        watchdog.warn = screen.warn
    gateways: list[Gateway] = []
    recorders: list[Recorder] = []
    status_tasks: list[asyncio.Task[None]] = []
    broker = None
    phone = PhoneInstructions()
    web = None if config.page is None else WebServer(partial(load_console, config.page, gateways))
    discovery = DiscoveryAnswers(screen.warn)

    def surface_offers() -> list[Offer]:
        return network_offers(name for gateway in gateways for name in gateway.names()) if config.discovery else []

    def network_surface_offers() -> list[Offer]:
        return [offer for offer in surface_offers() if offer.is_reachable_by_others]

    def reachable_offers() -> list[Offer]:
        every = network_offers(name for gateway in gateways for name in gateway.names())
        return [offer for offer in [*every, *console_offers(gateways[0].web)] if offer.is_reachable_by_others]

    ask_for_short_slices()
    if warning := raise_file_limit(_max_programs(config), len(config.mount) + len(config.surface)):
        screen.warn(warning)
    for mount in config.mount:
        wire_log = WireLog(time.time)
        if config.log:
            wire_log.sinks.append(_log_sink(config, mount))
        else:
            wire_log.on_refusal = screen.warn
        gateways.append(Gateway(mount, _surfaces_of(config, mount), wire_log, sky, time.time, screen.warn, watchdog))
        gateways[-1].web = web or WebServer(partial(load_console, None, gateways[-1:]))
        gateways[-1].open_state_store()
        if mount.record:
            from gateway.app.recording.recorder import record

            recorders.append(record(Path(mount.record), gateways[-1]))
    call_before_suspension(lambda: _stop_before_suspension(gateways, screen))

    almanac = AlmanacKeeper(sky, screen.warn, lambda: not any(gateway.moving for gateway in gateways))
    try:
        almanac.open(config.almanac)
        for gateway in gateways:
            await gateway.open()
        await discovery.answer_skyfi(network_surface_offers())
        if banner:
            screen.say(banner)
        status_tasks = start_status_updates(gateways, screen)

        broker = open_broker(config, access, gateways, screen)
        patient, longest = config.wait or len(gateways) > 1, 0.0 if config.wait is False else SEARCH_TIMEOUT

        to_be_ready = list(gateways)

        async def ready(gateway: Gateway) -> None:
            if watchdog is not None:
                watchdog.start()
            first = asyncio.ensure_future(_print_first_messages(gateway, screen, len(gateways) > 1))
            status_tasks.append(first)
            if gateway.controller.identified.is_set():
                await asyncio.wait([first], timeout=SITE_AND_CLOCK_WAIT)
            for caution in gateway.start_warnings():
                screen.warn(caution)
            for line in phone.new_lines(network_offers(gateway.names())):
                screen.say(line)
            for name in gateway.names():
                screen.say(f"ready {name}")
            to_be_ready.remove(gateway)
            if not to_be_ready:
                notify("READY=1")

        status_tasks.append(asyncio.ensure_future(almanac.run()))
        await race(done, asyncio.gather(*(make_ready(each, patient, longest, ready, screen.warn) for each in gateways)))
        garbage.exclude_present_objects()
        if config.page is not None and not done.is_set():
            await open_console(config.page, gateways[0].web, screen, phone)
        if config.discovery:
            await discovery.answer_discovery([*surface_offers(), *http_offers(gateways[0].web)])
        job_task = None if job is None or done.is_set() else asyncio.ensure_future(job(gateways[0]))
        if job_task is not None:
            job_task.add_done_callback(lambda _: done.set())
        status_tasks.append(asyncio.ensure_future(_say_new_addresses(phone, reachable_offers, screen.say)))
        await done.wait()
        if job_task is not None:
            job_task.cancel()  # nothing happens if it has ended
            with suppress(asyncio.CancelledError):
                await job_task
    finally:
        notify("STOPPING=1")
        for task in status_tasks:
            task.cancel()
        screen.clear()
        for each in gateways:
            await each.web.close()
        moved = [gateway.moving for gateway in gateways]
        discovery.close()
        await asyncio.gather(*(gateway.close() for gateway in gateways))
        if broker is not None:
            await broker.close()
        if done.is_set():
            for gateway, busy in zip(gateways, moved, strict=True):
                _print_last_message(gateway, busy, screen, len(gateways) > 1)
        if watchdog is not None:
            watchdog.close()
        for recorder in recorders:
            await recorder.close()
    return 0


async def _say_new_addresses(
    phone_lines: PhoneInstructions, get_offers: Callable[[], list[Offer]], say: Callable[[str], None]
) -> None:
    """Until cancelled, print new addresses for a phone, for example when the Wi-Fi connects after the start."""
    while True:
        await asyncio.sleep(ADDRESS_CHECK_PERIOD)
        for line in phone_lines.new_lines(get_offers()):
            say(line)


async def _print_first_messages(gateway: Gateway, screen: Screen, several_mounts: bool) -> None:
    """Print what was found, and warnings, once the mount has reported its identity, site and clock."""
    from gateway.app.control.user_messages import first_messages

    await gateway.controller.site_read.wait()
    for message in first_messages(gateway.controller, gateway.mount.model, gateway.mount.version):
        (screen.warn if message.is_warning else screen.say)(f"{gateway.title}: " * several_mounts + message.text)


def _print_last_message(gateway: Gateway, was_moving: bool, screen: Screen, several_mounts: bool) -> None:
    """Print the last message, if the gateway was prepared: the actions at the end, and the mount's final state."""
    from gateway.app.control.user_messages import last_message

    message = last_message(gateway.controller, was_moving) if gateway.is_prepared else None
    if message is not None:
        (screen.warn if message.is_warning else screen.say)(f"{gateway.title}: " * several_mounts + message.text)


def _surfaces_of(config: Config, mount: MountConfig) -> list[SurfaceConfig]:
    """Return the surfaces of a mount, in the order in which they are numbered."""
    return [*config.surfaces_of(mount), *http_surfaces(config, mount)]


def _log_sink(config: Config, mount: MountConfig) -> Sink:
    """Return the sink of the wire log that prints the exchanges with one mount, or the part chosen by ``--log``."""
    from gateway.diagnostics.log.printing import RowBuilder, line_printer

    surfaces = [str(parse_endpoint(surface.at)) for surface in _surfaces_of(config, mount)]
    rows = RowBuilder(parse_endpoint(mount.at).protocol, surfaces, as_json.filter_name(config.log), mount.name or "")
    if as_json.selects_json(config.log):
        return as_json.json_printer(rows, sys.stderr, mount.name or mount.at)
    return line_printer(rows, sys.stderr, config.night)


async def _stop_before_suspension(gateways: Sequence[Gateway], screen: Screen) -> None:
    """Stop all moving mounts before this process is suspended, and print what was done."""
    moving = [gateway for gateway in gateways if gateway.moving]
    try:
        async with asyncio.timeout(SUSPEND_TIMEOUT):
            await asyncio.gather(*(gateway.controller.stop() for gateway in moving))
        outcome = "the mount was stopped" if moving else "the mount was not moving"
    except (Fault, TimeoutError):
        outcome = "the mount has not acknowledged the stop; look at it"
    for gateway in gateways:
        if gateway.watchdog_mount is not None:
            gateway.watchdog_mount.report_changes()  # else the watchdog process, without heartbeats now, stops it again
    screen.warn(f"suspended: {outcome}. Programs get no answers until the gateway continues (fg, or bg)")


def _max_programs(config: Config) -> int:
    """Return how many programs may be connected at a time."""
    return sum(surface.max_clients if "://" in parse_endpoint(surface.at).where else 1 for surface in config.surface)
