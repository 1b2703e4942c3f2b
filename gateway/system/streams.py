"""Standard output and standard error, which may be closed, full, an unread pipe, or read by systemd's journal.

If its output fails, the gateway continues, because a mount depends on it. If a standard stream was closed before the
program began, its descriptor is opened again at once, because the first socket would get it otherwise. A line for the
journal begins with its level, sd-daemon(3)'s ``<N>``; a line for any other stream does not. ``JOURNAL_STREAM``
(systemd.exec(5)) is the device and inode of the stream that the journal reads.
"""

from __future__ import annotations

import codecs
import contextlib
import errno
import io
import os
import re
import sys
from typing import TextIO

#: The syslog levels that are used.
ERROR, WARNING, NOTICE, INFO = 3, 4, 5, 6
#: Control characters except tab and line feed.
_CONTROL_CHARACTERS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
#: Character -> its replacement on a stream that cannot encode it; any other becomes a question mark.
ASCII_FORMS = {
    "°": "d", "′": "'", "″": '"', "…": "...", "–": "-", "—": "-", "−": "-", "×": "x", "·": "-", "±": "+/-", "≤": "<=",
    "≥": ">=", "→": "->", "←": "<-", "“": '"', "”": '"', "‘": "'", "’": "'",
}  # fmt: skip
#: Errors of a stream that cannot be written to.
WRITE_ERRORS = (errno.ENOSPC, errno.EPIPE, errno.EBADF, errno.EIO, errno.EFBIG)


def reopen_closed_streams() -> None:
    """Open closed standard streams, so that no socket gets their descriptors. Writing then fails. Call this first."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if number else os.O_WRONLY)  # the lowest free number: this descriptor
    if sys.stdout is None:
        sys.stdout = os.fdopen(1, "w", closefd=False)
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)


def print_line(text: str) -> None:
    """Print a line on stdout. If that fails, warn once on stderr, and print no more lines."""
    try:
        print(text, flush=True)
    except (OSError, ValueError) as error:
        redirect_to_null(sys.stdout)
        warn(
            f"stdout cannot be written to ({reason_of(error)}): the addresses for programs cannot be shown; "
            "mount-gateway serves all the same",
            WARNING,
        )


def _ascii_replacement(error: UnicodeError) -> tuple[str, int]:
    """Return the replacement of characters that a stream cannot encode, and the index after them."""
    assert isinstance(error, UnicodeEncodeError)
    return "".join(ASCII_FORMS.get(character, "?") for character in error.object[error.start : error.end]), error.end


def set_encoding_fallback() -> None:
    """Make stdout and stderr replace characters that they cannot encode (cp437, ascii) instead of failing."""
    codecs.register_error("plain", _ascii_replacement)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain")


def warn(text: str, level: int) -> None:
    """Print a message of this program on stderr, with its syslog level; do nothing if that fails."""
    print_to_stderr(message_line(text, level, sys.stderr))


def print_to_stderr(line: str) -> None:
    """Print a line on stderr; do nothing if that fails."""
    try:
        print(line, file=sys.stderr, flush=True)
    except (OSError, ValueError):
        redirect_to_null(sys.stderr)


def is_read_by_journal(stream: TextIO) -> bool:
    """Whether the journal reads this stream, and it was not redirected to a file or a terminal."""
    try:
        status = os.fstat(stream.fileno())
    except (OSError, ValueError):  # it has no descriptor, or is closed
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


def journal_prefix(syslog_level: int, stream: TextIO) -> str:
    """Return the prefix of a line: ``<4>`` for level 4 if the journal reads the stream, else nothing."""
    return f"<{syslog_level}>" if is_read_by_journal(stream) else ""


def message_line(text: str, syslog_level: int, stream: TextIO) -> str:
    """Return a message of this program as a line, with the program's name unless the journal adds it.
    Control characters are escaped, because parts of the text may come from a file or a command line.
    """
    text = _CONTROL_CHARACTERS.sub(lambda match: f"\\x{ord(match.group()):02x}", text)
    return f"<{syslog_level}>{text}" if is_read_by_journal(stream) else f"mount-gateway: {text}"


def is_write_error(error: OSError) -> bool:
    """Whether this error is a failed write to an open stream, not the failure to open a file."""
    return error.filename is None and error.errno in WRITE_ERRORS


def flush_stdout() -> Exception | None:
    """Flush stdout. Return the error if that fails, else None."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as error:
        redirect_to_null(sys.stdout)
        return error
    return None


def redirect_to_null(stream: TextIO) -> None:
    """Redirect a stream to the null device, so that Python does not report a failed flush when it exits."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
    with contextlib.suppress(OSError, ValueError):
        stream.flush()


def reason_of(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
