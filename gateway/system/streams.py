"""Standard output and standard error: they may be closed, full, a pipe that nobody reads, or read by systemd's journal.

A gateway whose output fails goes on, because a mount depends on it. If a standard stream was closed before the program
began, its descriptor is taken at once; otherwise the first socket would get it. The journal has a clock of its own and
reads a level at a line's start: it is known by ``JOURNAL_STREAM`` (systemd.exec(5)), the device and inode of the stream
it reads, and the level is sd-daemon(3)'s ``<N>``. Anywhere else a line is for people and looks as always.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import sys
from typing import TextIO

#: Syslog's levels, as far as they are used.
ERROR, WARNING, NOTICE, INFO = 3, 4, 5, 6
#: All but a tab and a line's end.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
#: What a stream that cannot be written to says.
WRITING = (errno.ENOSPC, errno.EPIPE, errno.EBADF, errno.EIO, errno.EFBIG)


def take_up() -> None:
    """Open the standard streams that are closed, so that writing to them fails as it did; to be done first of all."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number else os.O_WRONLY)  # the lowest number that is free: this one
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", closefd=False)
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)


def say(text: str) -> None:
    """A line on stdout; where that cannot be written to, the rest is told to nobody, which stderr says once."""
    try:
        print(text, flush=True)
    except (OSError, ValueError) as error:
        give_up(sys.stdout)
        warn(
            f"stdout cannot be written to ({reason(error)}): where programs can connect is not told there; "
            "mount-gateway serves all the same",
            WARNING,
        )


def tolerate() -> None:
    """A degree sign that stdout's encoding does not have is shown as a question mark, instead of ending the program."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def warn(text: str, level: int) -> None:
    """A line on stderr, where there still is one, with who says it."""
    tell(message(text, level, sys.stderr))


def tell(line: str) -> None:
    """A line as it is on stderr, where there still is one."""
    try:
        print(line, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        give_up(sys.stderr)


def in_journal(stream: TextIO) -> bool:
    """Whether the journal reads this stream, and not a file or a terminal that it was led to."""
    try:
        found = os.fstat(stream.fileno())
    except (OSError, ValueError):  # no file behind it, or a closed one
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{found.st_dev}:{found.st_ino}"


def level(number: int, stream: TextIO) -> str:
    """What a line of this level begins with on a stream: ``<4>`` where the journal reads it, else nothing."""
    return f"<{number}>" if in_journal(stream) else ""


def message(text: str, number: int, stream: TextIO) -> str:
    """A line by the program itself, who says so where the journal does not.

    What it tells of may come from a file or a command line: it cannot rewrite the terminal.
    """
    text = _CONTROL.sub(lambda found: f"\\x{ord(found.group()):02x}", text)
    return f"<{number}>{text}" if in_journal(stream) else f"mount-gateway: {text}"


def of_writing(error: OSError) -> bool:
    """Whether this is what comes of writing to a stream that is open: such an error knows of no file."""
    return error.filename is None and error.errno in WRITING


def flush() -> Exception | None:
    """Have everything written that was said on stdout -> why that cannot be; None when it could."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as error:
        give_up(sys.stdout)
        return error
    return None


def give_up(stream: TextIO) -> None:
    """Nothing that was or will be said on this stream goes anywhere: else Python complains of it at the end."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    with contextlib.suppress(OSError, ValueError):
        stream.flush()


def reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
