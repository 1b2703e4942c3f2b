"""What is said, as systemd's journal wants it: the journal has a clock of its own, and reads a level at a line's start.

Its protocol is ``JOURNAL_STREAM`` (systemd.exec(5)), the device and inode of the stream it reads, and sd-daemon(3)'s
``<N>`` before a line. Anywhere else, on a terminal or in a file, a line is for people and looks as always.
"""

from __future__ import annotations

import os
import re
from typing import TextIO

#: Syslog's levels, as far as they are used.
ERROR, WARNING, NOTICE, INFO = 3, 4, 5, 6


#: All but a tab and a line's end.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")


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
