"""A night as a recording would hold it: a NexStar is asked for its place, sent about, loses its cable; a program asks.

Written line by line, so that what a report must say of it is known.
"""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

from gateway.app.recording.format import FILE_HEADER, FORMAT_VERSION, RECORDER_SIDE, escape
from gateway.astro.ephemeris.sky import Sky

#: 20 November 2026, 17:30 UTC; a site near Munich; what is looked at, and from which minute on.
BEGAN, SITE = 1795195800.0, (48.137, 11.575)
TARGETS = ((0, 279.2, 38.8), (60, 350.8, 58.8), (120, 10.7, 41.3), (240, 56.9, 24.1), (330, 83.8, -5.4))
REFUSED = "Goto: it would lead below the horizon (5 degrees), the limit is 12 degrees"


def settings(**more: Any) -> dict[str, Any]:
    """The head of a recording."""
    mount = {"at": "nexstar:cpc/4.21@/dev/ttyUSB0", "site": SITE, "equinox": "jnow", "lowest": 12.0, "highest": 85.0}
    surfaces = [{"at": "lx200@tcp://127.0.0.1:4030"}, {"at": "nexstar@tcp://0.0.0.0:4031"}]
    return {"began": BEGAN, "from": 0.0, "config": {"mount": {**mount, **more}, "surface": surfaces}}


def head(**more: Any) -> str:
    return f"{FILE_HEADER}{FORMAT_VERSION}\n# {json.dumps(settings(**more))}\n"


def turn(degrees: float) -> str:
    """A place on one axis as a NexStar writes it."""
    return f"{round(degrees % 360.0 / 360.0 * 2**24) % 2**24 << 8:08X}"


class Tape:
    """Lines of a recording in order of time."""

    def __init__(self) -> None:
        self.lines: list[tuple[float, str]] = []

    def put(self, at: float, side: str, arrow: str, data: bytes | str = b"") -> None:
        text = escape(data) if isinstance(data, bytes) else data
        self.lines.append((at, f"{at:.6f} {side} {arrow} {text}".rstrip(" ")))

    def asked(self, at: float, question: bytes, answer: bytes, took: float) -> None:
        """Of the mount."""
        self.put(at, "mount", ">", question)
        self.put(at + took, "mount", "<", answer)

    def text(self, **more: Any) -> str:
        lines = sorted(self.lines, key=lambda one: one[0])
        end = lines[-1][0] if lines else 0.0
        return "".join([head(**more), *(f"{line}\n" for _, line in lines), f"{end:.6f} {RECORDER_SIDE} ! ends here\n"])


def night(path: Path, minutes: int = 420, every: float = 10.0) -> Path:
    """A whole night."""
    chance, tape, sky = random.Random(1), Tape(), Sky()
    tape.put(0.0, "mount", "^")
    tape.put(1.0, "10.0.0.2:50122", "+", "surface 1, host 10.0.0.2")
    tape.put(2.0, "10.0.0.7:50200", "+", "surface 2, host 10.0.0.7")
    ra = dec = 0.0
    goal = TARGETS[0][1:]
    at = 3.0
    while at < minutes * 60.0:
        for minute, *place in TARGETS:
            if 0.0 <= at - minute * 60.0 < every:
                goal = sky.from_j2000(*place, BEGAN + at)
                tape.asked(at + 1.0, b"r" + f"{turn(goal[0])},{turn(goal[1])}".encode(), b"#", 0.08)
                tape.put(at + 0.9, "10.0.0.2:50122", ">", b":MS#")
                tape.put(at + 1.2, "10.0.0.2:50122", "<", b"0")
        ra += max(-8.0, min(8.0, (goal[0] - ra + 180.0) % 360.0 - 180.0))
        dec += max(-8.0, min(8.0, goal[1] - dec))
        took = 0.055 + chance.expovariate(1 / 0.012) + (0.4 if chance.random() < 0.004 else 0.0)
        if not 9000.0 < at < 9300.0:
            tape.asked(at, b"e", f"{turn(ra)},{turn(dec)}#".encode(), took)
        for side, question in (("10.0.0.2:50122", b":GR#"), ("10.0.0.2:50122", b":GD#"), ("10.0.0.7:50200", b"e")):
            tape.put(at + 2.0, side, ">", question)
        at += every
    tape.put(9000.0, "mount", "v", "no answer to e within 3.5 s, three times")
    tape.put(9300.0, "mount", "^")
    for minute in (100, 101, 130):
        tape.put(minute * 60.0 + 0.5, "10.0.0.2:50122", "!", REFUSED)
    tape.put(16000.0, "10.0.0.7:50200", "!", "pulse guiding: this mount has none")
    path.write_text(tape.text())
    return path
