"""``run``: connect clients to a mount, as the command line and ``gateway.toml`` say."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from gateway.cli.serving import serve_gateway, with_loop
from gateway.config import Config, check, make_config, parse_site, read_config
from gateway.errors import UserError


def add(commands: Any) -> None:
    """Put the command into the parser."""
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
    run.add_argument("--baud", type=int, help="baud rate of the mount's port (default 9600)")
    run.add_argument("--wait", action="store_true", help="keep trying when no mount answers; clients stay connected")
    run.add_argument("--log", action="store_true", help="show the conversation on both sides, decoded")
    run.add_argument("--loop", choices=("fast", "asyncio"), default="fast", help="event loop: uvloop where it exists")
    run.set_defaults(run=_run)


def _run(arguments: argparse.Namespace) -> int:
    config = _config(arguments)
    return with_loop(arguments.loop == "fast", lambda: serve_gateway(config))


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
    for key in ("mode", "equinox", "site-time", "lowest", "highest", "sync-limit", "baud"):
        value = getattr(arguments, key.replace("-", "_"))
        if value is not None:
            mount[key] = value
    if arguments.site:
        mount["site"] = parse_site(arguments.site)
    if "at" not in mount:
        raise UserError("run: which mount? --mount nexstar@/dev/ttyUSB0, or --config gateway.toml")
    top = {**top, "wait": top.get("wait") or arguments.wait, "log": top.get("log") or arguments.log}
    return check(make_config({**top, "mount": mount, "surface": surfaces}, where), where)
