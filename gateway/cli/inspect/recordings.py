"""``decode`` and ``report``: show a recording as text, or make a web page of it.

``decode`` understands captures of a serial line as well.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError
from gateway.protocols.registry import PROTOCOLS, guess_protocol
from gateway.system.files import open_regular_file

if TYPE_CHECKING:
    from gateway.diagnostics.decode import Capture


def add_decode(commands: Commands) -> None:
    decode = commands.add_parser(
        "decode",
        description="Prints a recording, command by command. Understands recordings of run --record, and logs of "
        "pyserial's spy:// and of socat -x.",
        epilog="Example:\n  mount-gateway decode night.rec | less",
    )
    decode.add_argument("file", type=Path, metavar="FILE", help="the recording, or the capture")
    decode.add_argument("--protocol", choices=tuple(PROTOCOLS), help="of a capture; without it, it is guessed")
    decode.set_defaults(run=_run_decode)


def _run_decode(arguments: argparse.Namespace) -> int:
    from gateway.diagnostics.decode import Capture, decode
    from gateway.diagnostics.log.conversation import ConnectionDecoder
    from gateway.diagnostics.recorded_sides import ConnectionProtocols

    path = arguments.file
    capture = Capture(path)
    recording = capture.recording
    if recording is not None:
        sides = ConnectionProtocols(recording)
        lines = decode(sides.protocol_lines_first(capture), sides.decoder, recording.settings["began"])
    else:
        protocol = arguments.protocol or _guess_protocol(capture, path)
        lines = decode(capture, lambda side: ConnectionDecoder(protocol), 0.0)
    for line in lines:
        print(line)
    if recording is not None and recording.incomplete_reason:
        print(recording.incomplete_reason)
    return 0


def _guess_protocol(capture: Capture, path: Path) -> str:
    """Guess the protocol of a capture from the bytes that a client sent. Raises UserError."""
    protocol = guess_protocol(capture.first_client_bytes())
    if protocol is None:
        raise UserError(f"{path}: nothing in it was sent by a client; name the protocol with --protocol")
    return protocol


def add_report(commands: Commands) -> None:
    report = commands.add_parser(
        "report",
        description="Writes one HTML file that shows where the telescope pointed, how long the mount "
        "took to answer, what went wrong, what every program sent, and what was refused and why.",
        epilog="Example:\n  mount-gateway report night.rec -o night.html",
    )
    report.add_argument("recording", type=Path, metavar="FILE", help="a recording of run --record, or of the console")
    report.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="HTML",
        help="the file to write; without it, the recording's name with .html",
    )
    report.add_argument("--force", action="store_true", help="overwrite a file that is not a report")
    report.set_defaults(run=_run_report)


def _run_report(arguments: argparse.Namespace) -> int:
    from gateway.app.recording.format import read
    from gateway.cli.inspect.detect import write_atomically
    from gateway.diagnostics.report.gather import gather_night
    from gateway.diagnostics.report.page import report_page

    path: Path = arguments.recording
    target: Path = arguments.output or path.with_name(f"{path.name.removesuffix('.rec')}.html")
    recording = read(path)
    if target in (path, *recording.parts):
        raise UserError(f"{target}: this is the recording itself; -o says where the report goes")
    night = gather_night(recording)
    write_atomically(target, report_page(night, path.name), arguments.force or _is_report(target))
    print(f"wrote {target}")
    if night.cut_reason:
        print(night.cut_reason)
    return 0


def _is_report(path: Path) -> bool:
    """Whether a file is an earlier report, which a new report may replace."""
    try:
        with open_regular_file(path) as file:
            return b"<title>The night of " in file.read(400)
    except OSError:
        return False
