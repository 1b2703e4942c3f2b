"""Places that cannot be meant as they are written: an address without its scheme, a port without its folder."""

from __future__ import annotations

import os
import re
from pathlib import Path

_ADDRESS = re.compile(r"(?:(tcp|socket|rfc2217):/?)?([\w.-]+|\[[\w:]+\]):(\d{1,5})")


def right(where: str, listening: bool, devices: Path = Path("/dev")) -> str:
    """What was probably meant by the place of a surface (``listening``) or of a mount; empty where it may be right."""
    scheme, slashes, rest = where.partition("://")
    if slashes:
        wrong, good = ("socket", "tcp") if listening else ("tcp", "socket")
        return f"{good}://{rest}" if scheme == wrong else ""
    if match := _ADDRESS.fullmatch(where):
        known = match[1] if match[1] == "rfc2217" else "tcp" if listening else "socket"
        return f"{known}://{match[2]}:{match[3]}"
    if listening and re.fullmatch(r":?\d{1,5}", where):
        return f"tcp://127.0.0.1:{where.lstrip(':')}"
    if not listening and where.startswith("pty:"):
        return where.removeprefix("pty:")
    if re.fullmatch(r"[\w.-]+", where) and not os.path.exists(where) and (devices / where).exists():
        return str(devices / where)
    return ""
