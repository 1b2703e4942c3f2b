"""``detect``: finds which mount is on which serial port, and prints how to start a gateway with it.

Exit code 0 if a mount was found, 1 if none was, 2 for a user's mistake.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import errno
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError, explain_file_error
from gateway.system.files import NOT_REGULAR_FILE

if TYPE_CHECKING:
    from gateway.diagnostics.detect.scan_port import PortFinding

NONE_FOUND_EXIT_CODE = 1


def add_detect(commands: Commands) -> None:
    detect = commands.add_parser(
        "detect",
        description="Looks for a mount on all serial ports and for ASCOM Alpaca telescopes in the network, or at those "
                    "given. A port is asked two harmless "
                    "questions (Kx, then ACK), and one named as lx200@ a third (:GR#), first at 9600 baud; nothing "
                    "moves. Exit code 0: a mount was found, 1: none.",
        epilog="Examples:\n  mount-gateway detect\n  mount-gateway detect /dev/ttyUSB0 --write gateway.toml\n"
               "  mount-gateway detect --network --write gateway.toml      for programs on a phone, too\n"
               "  mount-gateway detect socket://192.168.1.50:4030\n"
               "  mount-gateway detect http://192.168.1.60:11111",
    )  # fmt: skip
    detect.add_argument(
        "port",
        nargs="*",
        metavar="PORT",
        help="a device, a pyserial URL (socket://HOST:PORT, rfc2217://HOST:PORT), an Alpaca server "
        "(http://HOST:PORT), or with its protocol lx200@/dev/ttyUSB0: some old classics do not answer ACK",
    )
    detect.add_argument(
        "--network",
        action="store_true",
        help="let phones and other computers connect, in the file of --write or --toml",
    )
    detect.add_argument("--toml", action="store_true", help="print a gateway.toml for each mount")
    detect.add_argument("--json", action="store_true", help="print JSON: a list, one object a port")
    detect.add_argument("--write", type=Path, metavar="FILE", help="write a gateway.toml for the mount that was found")
    detect.add_argument("--force", action="store_true", help="let --write replace a file")
    detect.set_defaults(run=_run_detect)


def _run_detect(arguments: argparse.Namespace) -> int:
    import json

    from gateway.diagnostics.detect.ports import local_ports, parse_port
    from gateway.diagnostics.detect.report import as_toml, describe_port, next_steps, port_values
    from gateway.diagnostics.detect.scan_port import ask_servers, examine_ports

    if arguments.write is not None and not arguments.force and arguments.write.exists():
        raise _file_exists_error(arguments.write)
    if arguments.write is not None and not arguments.write.parent.is_dir():
        missing = FileNotFoundError(errno.ENOENT, "")
        raise UserError(f"{arguments.write}: {explain_file_error(arguments.write, missing)}")
    places = (
        list({place.url: place for place in map(parse_port, arguments.port)}.values())
        if arguments.port
        else local_ports()
    )
    urls = [place.url for place in places if place.url.startswith("http://")]
    ports = [place for place in places if place.url not in urls]
    if not arguments.json:
        print(_scan_message(len(ports), not arguments.port, bool(urls)), file=sys.stderr, flush=True)

    async def scan() -> list[PortFinding]:
        offered = ask_servers(urls) if arguments.port else ask_servers(None)
        return [server for several in await asyncio.gather(examine_ports(ports), offered) for server in several]

    findings = asyncio.run(scan())
    if not findings:
        print("[]" if arguments.json else "no mount was found", flush=True)
        _print_next_steps(next_steps([]), arguments.json)
        return NONE_FOUND_EXIT_CODE
    if arguments.json:
        print(json.dumps([port_values(finding, arguments.network) for finding in findings], indent=2))
    else:
        print("\n\n".join(map(describe_port, findings)))
    mounts = [finding for finding in findings if finding.mount]
    if arguments.toml and not arguments.json:
        print("", *(as_toml(finding, arguments.network) for finding in mounts), sep="\n", end="")
    if mounts and arguments.write is not None:
        _write_config(arguments.write, mounts, arguments.force, arguments.network)
    _print_next_steps(next_steps(findings), arguments.json)
    return 0 if mounts else NONE_FOUND_EXIT_CODE


def _scan_message(port_count: int, scans_network: bool, asks_servers: bool) -> str:
    """Return the message that says what is being scanned, and how long that may take."""
    at = [f"{port_count} ports" if port_count > 1 else "1 port"] if port_count else []
    at += ["the servers in the network"] if scans_network else ["what the server offers"] if asks_servers else []
    return f"looking at {' and '.join(at)}, up to {25 if port_count else 5} s …"


def _print_next_steps(steps: list[str], prints_json: bool) -> None:
    """Print what the user can try next, unless the output is JSON."""
    if steps and not prints_json:
        sys.stdout.flush()
        print("What to try next:", *(f"  - {step}" for step in steps), sep="\n", file=sys.stderr)


def _write_config(path: Path, mounts: list[PortFinding], force: bool, allows_network: bool) -> None:
    """Write a gateway.toml for the mount that was found. Raises UserError, also if several were found."""
    from gateway.diagnostics.detect.report import as_toml

    if len(mounts) > 1:
        names = " and ".join(finding.port.url for finding in mounts)
        raise UserError(f"--write {path}: there are mounts on {names}; name one of them")
    write_atomically(path, as_toml(mounts[0], allows_network), force)
    only_here = "this computer only; --network lets phones and other computers in"
    who = "phones and other computers, too" if allows_network else only_here
    print(f"wrote {path}, for programs on {who}\nstart it: mount-gateway run {path}", file=sys.stderr)


def write_atomically(path: Path, text: str, force: bool) -> None:
    """Write a file whole or not at all; replace an existing file only with ``force``. Raises UserError."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    reserved = False
    try:
        if not force:
            path.open("x").close()
            reserved = True
        elif path.exists() and not (path.is_file() or path.is_dir()):
            raise OSError(errno.EINVAL, NOT_REGULAR_FILE)
        draft.write_text(text, "utf-8")
        os.replace(draft, path)
    except FileExistsError:
        raise _file_exists_error(path) from None
    except OSError as error:
        for leftover in [draft, path][: 1 + reserved]:
            with contextlib.suppress(OSError):
                leftover.unlink()
        raise UserError(f"{path}: {explain_file_error(path, error)}") from None


def _file_exists_error(path: Path) -> UserError:
    return UserError(f"{path} exists already; --force replaces it")
