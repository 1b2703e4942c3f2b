"""Standard output and standard error that may be closed, full, or a pipe that nobody reads.

A gateway whose output fails goes on, because a mount depends on it. If a standard stream was closed before the program
began, its descriptor is taken at once; otherwise the first socket would get it.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from typing import TextIO

from gateway.system import journal

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
            journal.WARNING,
        )


def tolerate() -> None:
    """A degree sign that stdout's encoding does not have is shown as a question mark, instead of ending the program."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def warn(text: str, level: int) -> None:
    """A line on stderr, where there still is one, with who says it."""
    tell(journal.message(text, level, sys.stderr))


def tell(line: str) -> None:
    """A line as it is on stderr, where there still is one."""
    try:
        print(line, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        give_up(sys.stderr)


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
    """In words."""
    return str(getattr(error, "strerror", None) or error)
