"""``report``: a recording as one HTML file with plots."""

from __future__ import annotations

import argparse
from pathlib import Path

from gateway.cli.help import Commands
from gateway.core.errors import UserError


def add(commands: Commands) -> None:
    report = commands.add_parser(
        "report",
        help="a recording as a page with plots",
        description="Writes one HTML file that needs nothing else: where the telescope pointed, how long the mount "
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
    report.add_argument("--force", action="store_true", help="let it replace a file that is no report")
    report.set_defaults(run=_report)


def _report(arguments: argparse.Namespace) -> int:
    from gateway.app.recording.format import read
    from gateway.cli.inspect.detect import write_whole
    from gateway.diagnostics.report.gather import gather
    from gateway.diagnostics.report.page import page

    path: Path = arguments.recording
    target: Path = arguments.output or path.with_name(f"{path.name.removesuffix('.rec')}.html")
    recording = read(path)
    if target in (path, *recording.parts):
        raise UserError(f"{target}: this is the recording itself; -o says where the report goes")
    night = gather(recording)
    write_whole(target, page(night, path.name), arguments.force or _is_report(target))
    print(f"wrote {target}")
    if night.cut:
        print(night.cut)
    return 0


def _is_report(path: Path) -> bool:
    """Whether there is an older report, which a newer one may replace."""
    try:
        with path.open("rb") as file:
            return b"<title>The night of " in file.read(400)
    except OSError:
        return False
