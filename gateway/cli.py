"""The command line. One line per open endpoint on stdout; a mistake is one line on stderr and exit code 2."""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, NoReturn

from gateway import __version__
from gateway.config import Config, check, make_config, parse_device, parse_endpoint, parse_site, read_config
from gateway.errors import UserError

#: How long a mount may take to say its first word (a hand control's worst), and to say all that it is asked.
FIRST_WORD, FIND_MOUNT = 4.0, 20.0
#: With --wait, how long the ready lines wait for the mount to say what fits it.
QUICK = 0.5
DEMO_PORT = 4030


def main(argv: list[str] | None = None) -> int:
    """Run a command -> its exit code: 0 done, 2 bad input."""
    try:
        arguments = _parser().parse_args(argv)
        return int(arguments.run(arguments) or 0)
    except UserError as error:
        print(f"mount-gateway: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 0
    except BrokenPipeError:
        sys.stderr.close()
        return 0


class _Parser(argparse.ArgumentParser):
    """One line for a mistake, as everywhere."""

    def error(self, message: str) -> NoReturn:
        raise UserError(f"{message} ({self.prog} --help tells more)")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="mount-gateway",
        description="Lets Meade LX200 software drive a Celestron NexStar mount, and the reverse.",
        epilog="An endpoint is PROTOCOL[:MODEL[/VERSION]]@WHERE, for example nexstar@/dev/ttyUSB0 or lx200@tcp://:4030.",
    )
    parser.add_argument("--version", action="version", version=f"mount-gateway {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    demo = commands.add_parser("demo", help="a simulated mount to play with, on TCP 4030 and a virtual serial port")
    demo.add_argument("--port", type=int, default=DEMO_PORT, help="TCP port (default 4030; 0 takes any free one)")
    demo.add_argument("--pty", metavar="PATH", help="virtual serial port (default /tmp/lx200, reversed /tmp/nexstar)")
    demo.add_argument("--reverse", action="store_true", help="the other way: NexStar programs on a simulated Meade")
    demo.add_argument("--speed", type=float, default=4.0, help="slews this many times faster than real (default 4)")
    demo.add_argument("--log", action="store_true", help="show the conversation on both sides")
    demo.set_defaults(run=_demo)

    run = commands.add_parser("run", help="connect clients to a mount")
    run.add_argument("--mount", metavar="ENDPOINT", help="for example nexstar@/dev/ttyUSB0; any pyserial URL will do")
    run.add_argument("--surface", metavar="ENDPOINT", action="append", default=[],
                     help="for example lx200@tcp://127.0.0.1:4030 or lx200:autostar@pty:/tmp/lx200; may be repeated")
    run.add_argument("--config", type=Path, metavar="FILE", help="read gateway.toml; what is given here wins")
    run.add_argument("--site", metavar="LAT,LON", help="where the mount stands, for hand controls that cannot tell")
    run.add_argument("--mode", choices=("alt-az", "eq-north", "eq-south"),
                     help="tracking mode, for hand controls that cannot tell (before 2.3)")
    run.add_argument("--equinox", choices=("jnow", "j2000", "auto"), help="what the mount's coordinates mean")
    run.add_argument("--site-time", choices=("unaligned", "always", "never"),
                     help="send the mount site and time that clients set? (default: while it is not aligned)")
    run.add_argument("--lowest", type=float, metavar="DEG", help="lowest altitude of a goto (default 0)")
    run.add_argument("--highest", type=float, metavar="DEG", help="highest altitude of a goto (default 90)")
    run.add_argument("--sync-limit", type=float, metavar="DEG", help="refuse syncs further than this (default 15)")
    run.add_argument("--sun", type=_degrees_or_off, metavar="DEG|off",
                     help="come no nearer to the Sun while it is up (default 20; off only for solar work)")
    run.add_argument("--hour-angle-limit", type=float, metavar="HOURS",
                     help="equatorial mounts: no farther past the meridian (default: no limit)")
    run.add_argument("--baud", type=int, help="baud rate of the mount's port (default 9600)")
    run.add_argument("--wait", action="store_true", help="keep trying when no mount answers; clients stay connected")
    run.add_argument("--log", action="store_true", help="show the conversation on both sides, decoded")
    run.add_argument("--loop", choices=("fast", "asyncio"), default="fast", help="event loop: uvloop where it exists")
    run.set_defaults(run=_run)

    sim = commands.add_parser("sim", help="a simulated mount for other programs")
    sim.add_argument("device", metavar="PROTOCOL[:MODEL[/VERSION]]", help="for example nexstar:cpc/4.21")
    sim.add_argument("--at", action="append", metavar="WHERE", help="tcp://HOST:PORT or pty:PATH; may be repeated")
    sim.add_argument("--latency", type=float, default=0.0, metavar="S", help="seconds to answer (a real one: 0.1-0.3)")
    sim.add_argument("--speed", type=float, default=1.0, help="slews this many times faster")
    sim.add_argument("--time", metavar="ISO", help="begin at this UTC time")
    sim.add_argument("--site", metavar="LAT,LON", default="45,10", help="default 45,10")
    sim.add_argument("--unaligned", action="store_true", help="as after power-on, before the star alignment")
    sim.set_defaults(run=_sim)

    tables = commands.add_parser("tables", help="what becomes of every command, per model")
    group = tables.add_mutually_exclusive_group()
    group.add_argument("--write", action="store_true", help="write mappings/README.md")
    group.add_argument("--check", action="store_true", help="fail when mappings/README.md is stale or a row is wrong")
    tables.set_defaults(run=_tables)

    explain = commands.add_parser("explain", help="what happens to one command, in words and bytes")
    explain.add_argument("client", choices=("lx200", "nexstar"), help="the protocol the command is written in")
    explain.add_argument("mount", choices=("lx200", "nexstar"), help="the protocol of the mount")
    explain.add_argument("command", help="for example ':Sr05:34:32#'; \\x06 and the like are understood")
    explain.set_defaults(run=_explain)
    return parser


# --- commands ---------------------------------------------------------------------------------------------------


def _run(arguments: argparse.Namespace) -> int:
    config = _config(arguments)
    return _with_loop(arguments.loop == "fast", lambda: _serve_gateway(config))


def _config(arguments: argparse.Namespace) -> Config:
    """The file and the flags as one; flags win."""
    mount: dict[str, Any] = {}
    surfaces: list[dict[str, Any]] = []
    where = "command line"
    top: dict[str, Any] = {}
    if arguments.config is not None:
        import msgspec

        where = str(arguments.config)
        held = msgspec.to_builtins(read_config(arguments.config))
        mount, surfaces = held.pop("mount"), held.pop("surface")
        top = held
    if arguments.mount:
        mount["at"] = arguments.mount
    if arguments.surface:
        surfaces = [{"at": surface} for surface in arguments.surface]
    for key in ("mode", "equinox", "site-time", "lowest", "highest", "sync-limit", "sun", "hour-angle-limit", "baud"):
        value = getattr(arguments, key.replace("-", "_"))
        if value is not None:
            mount[key] = value
    if arguments.site:
        mount["site"] = parse_site(arguments.site)
    if "at" not in mount:
        raise UserError("run: which mount? --mount nexstar@/dev/ttyUSB0, or --config gateway.toml")
    top = {**top, "wait": top.get("wait") or arguments.wait, "log": top.get("log") or arguments.log}
    return check(make_config({**top, "mount": mount, "surface": surfaces}, where), where)


def _degrees_or_off(text: str) -> float | str:
    """``off`` stays a word; what is neither that nor a number is a mistake."""
    try:
        return text if text == "off" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: write degrees, or off for solar work") from None


def _demo(arguments: argparse.Namespace) -> int:
    client, mount, words = ("lx200", "nexstar", "NexStar 6/8 SE, driven by whatever LX200")
    if arguments.reverse:
        client, mount, words = ("nexstar", "lx200:lx200gps", "LX200GPS, driven by whatever NexStar")
    surfaces = [{"at": f"{client}@tcp://127.0.0.1:{arguments.port}"}]
    if sys.platform != "win32":
        path = f"/tmp/{client}" if arguments.pty is None else arguments.pty
        surfaces.append({"at": f"{client}@pty:{path}"})
    tables = {"mount": {"at": f"{mount}@sim", "speed": arguments.speed}, "surface": surfaces, "log": arguments.log}
    config = check(make_config(tables, "demo"), "demo")
    print(f"A simulated {words} program connects. Ctrl-C ends it.", flush=True)
    return _with_loop(True, lambda: _serve_gateway(config))


def _sim(arguments: argparse.Namespace) -> int:
    from gateway.simulators import DEFAULT_MODEL, make_simulator, parse_time, running_clock

    endpoint = parse_device(arguments.device)
    if arguments.latency < 0 or arguments.speed <= 0:
        raise UserError("sim: --latency is 0 or more seconds, --speed more than 0")
    start = parse_time(arguments.time) if arguments.time else None
    simulator = make_simulator(endpoint, clock=running_clock(start), site=parse_site(arguments.site),
                               aligned=not arguments.unaligned, speed=arguments.speed)
    places = arguments.at or ["tcp://127.0.0.1:0"]
    name = f"{endpoint.protocol}:{endpoint.model or DEFAULT_MODEL[endpoint.protocol]}"
    return _with_loop(True, lambda: _serve_simulator(simulator, name, places, arguments.latency))


def _tables(arguments: argparse.Namespace) -> int:
    from gateway import pairs

    if arguments.check:
        return pairs.check()
    if arguments.write:
        print(f"wrote {pairs.write()}")
        return 0
    print(pairs.text())
    return 0


def _explain(arguments: argparse.Namespace) -> int:
    from gateway.explain import explain

    print(explain(arguments.client, arguments.mount, arguments.command))
    return 0


# --- serving ----------------------------------------------------------------------------------------------------


def _with_loop(fast: bool, serve: Callable[[], Awaitable[int]]) -> int:
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


def _until_signal() -> asyncio.Event:
    """An event that SIGINT and SIGTERM set."""
    done = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, done.set)
        except NotImplementedError:  # Windows
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(done.set))
    return done


async def _serve_gateway(config: Config) -> int:
    from gateway.assembly import Gateway
    from gateway.transcript import Transcript

    done = _until_signal()
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


async def _serve_simulator(simulator: Any, name: str, places: list[str], latency: float) -> int:
    from gateway.simulators import serve_simulator

    done = _until_signal()
    ports = await serve_simulator(simulator, places, latency)
    for port in ports:
        print(f"ready {name}@{port.where}", flush=True)
    await done.wait()
    for port in ports:
        await port.close()
    return 0
