"""Random things that programs say, legal and not: typed from the two papers, nothing taken from the mapping tables.

A step is bytes, the shape its reply must have, and whether the shape counts (after noise it does not). ``wild`` plays
also set site and clock to anything, so that nobody can say where the limits lie; ``synced`` ones sync.
"""

from __future__ import annotations

import re
from random import Random
from typing import NamedTuple

from tests.property.random_judge import Judge, sun
from tests.support.manual_files import raw, rows

SITE_AND_CLOCK = re.compile(rb":(S[tgGLCM-P]|W|hI|gT)|[WHI]|P.\xb2[\x83\x84\xb3]", re.DOTALL)
SITE_CLOCK_AND_SYNC = re.compile(SITE_AND_CLOCK.pattern + rb"|:C[ML]|[Ssu]", re.DOTALL)
SYNCS = re.compile(rb":C[ML]|[Ssu]")
#: Loses the alignment, wakes programs that run for minutes, or changes how the mount stands.
ALIGNS = re.compile(rb":A[aAP]|:I#|:hI")
#: The reply bytes of the opcodes of the manual, and of two that every hand control here answers.
REPLIES = {
    "E": 10,
    "e": 18,
    "Z": 10,
    "z": 18,
    "t": 2,
    "w": 9,
    "h": 9,
    "V": 3,
    "m": 2,
    "K": 2,
    "J": 2,
    "L": 2,
    "v": 2,
    "p": 2,
    **dict.fromkeys("RrBbSsTWHM", 1),
}
LX200_FORMS = rows("lx200_forms.txt") + rows("lx200_beyond.txt")
NEXSTAR_FORMS = rows("nexstar_forms.txt")


class Step(NamedTuple):
    """``shapes`` are regular expressions apart by `` ~ `` (``-``: silence), or the number of bytes; None: anything."""

    data: bytes
    shapes: str | int | None


def place(random: Random, judge: Judge) -> tuple[float, float]:
    """Where programs send a mount: anywhere, near a limit, near the Sun, near where it is."""
    kind = random.randrange(5)
    if kind == 0:
        return random.uniform(0.0, 360.0), random.uniform(-90.0, 90.0)
    if kind == 1:
        ra, dec = sun(judge.unix())
        return (ra + random.uniform(-40.0, 40.0)) % 360.0, max(-90.0, min(90.0, dec + random.uniform(-40.0, 40.0)))
    if kind == 2:
        ra, dec = judge.believed()
        return (ra + random.gauss(0.0, 8.0)) % 360.0, max(-90.0, min(90.0, dec + random.gauss(0.0, 8.0)))
    limit = random.choice((judge.lowest, judge.highest)) + random.gauss(0.0, 2.0)
    return judge.at(random.uniform(0.0, 360.0), max(-90.0, min(90.0, limit)))


def noise(random: Random, sample: bytes) -> bytes:
    """Bytes of chance, or a command that was cut, doubled or bent."""
    kind = random.randrange(5)
    if kind == 0:
        return random.randbytes(random.randrange(1, 20))
    at = random.randrange(len(sample))
    if kind == 1:
        return sample[: at + 1]
    if kind == 2:
        return sample[at:]
    if kind == 3:
        return sample[:at] + sample
    return sample[:at] + random.randbytes(1) + sample[at + 1 :]


# --- Meade ------------------------------------------------------------------------------------------------------------


def _clock_face(degrees: float) -> bytes:
    seconds = round(degrees / 15.0 * 3600.0) % 86400
    return b"%02d:%02d:%02d" % (seconds // 3600, seconds // 60 % 60, seconds % 60)


def _signed(degrees: float) -> bytes:
    seconds = round(abs(degrees) * 3600.0)
    sign = b"-" if degrees < 0 else b"+"
    return sign + b"%02d*%02d:%02d" % (seconds // 3600, seconds // 60 % 60, seconds % 60)


def _lx200_motion(random: Random, judge: Judge) -> list[Step]:
    """One of the things that move a mount or say how."""
    ra, dec = place(random, judge)
    target = [Step(b":Sr" + _clock_face(ra) + b"#", "1"), Step(b":Sd" + _signed(dec) + b"#", "1")]
    kind = random.randrange(12)
    if kind <= 2:
        return [*target, Step(b":MS#", r"0 ~ 1[^#]+# ~ 2[^#]+#")]
    if kind == 3:
        return [*target, Step(b":CM#", "[^#]*#")]
    if kind == 4:
        az, alt = random.randrange(360), random.randrange(-10, 91)
        return [Step(b":Sz%03d*00#" % az, "1 ~ 0"), Step(b":Sa%+03d*00#" % alt, "1 ~ 0"), Step(b":MA#", "0 ~ 1")]
    if kind <= 7:
        return [
            Step(random.choice([b":RG#", b":RC#", b":RM#", b":RS#", b":RS#"]), "-"),
            *(Step(b":M%c#" % random.choice(b"nsew"), "-") for _ in range(random.randrange(1, 3))),
        ]
    if kind == 8:
        return [Step(b":Q%c#" % random.choice(b"nsew"), "-")]
    if kind == 9:
        return [Step(b":Q#", "-")]
    if kind == 10:
        return [Step(b":Mg%c%04d#" % (random.choice(b"nsew"), random.randrange(5000)), "-")]
    return [Step(random.choice([b":So20*#", b":Sh70#", b":So-10*#", b":Sh90#", b":Sw5#", b":ST060.0#"]), "1 ~ 0")]


def lx200(random: Random, judge: Judge, model: str, wild: bool, synced: bool) -> list[Step]:
    """What a program says next to a Meade."""
    kind = random.randrange(20)
    if kind < 9:
        steps = _lx200_motion(random, judge)
    elif kind < 17:
        _, example, models, shapes = random.choice(LX200_FORMS)
        steps = [Step(raw(example), shapes if model in models.split(",") else None)]
    else:
        _, example, _, _ = random.choice(LX200_FORMS)
        steps = [Step(noise(random, raw(example)), None)]
    return [step for step in steps if _wanted(step.data, wild, synced)]


def _wanted(data: bytes, wild: bool, synced: bool) -> bool:
    if wild:
        return True
    return not (SITE_AND_CLOCK.search(data) or ALIGNS.search(data) or (not synced and SYNCS.search(data)))


# --- Celestron --------------------------------------------------------------------------------------------------------


def _pair(first: float, second: float, digits: int) -> bytes:
    count = 16**digits
    a, b = (round(angle / 360.0 * count) % count for angle in (first, second))
    return b"%0*X,%0*X" % (digits, a, digits, b)


def _nexstar_motion(random: Random, judge: Judge) -> list[Step]:
    ra, dec = place(random, judge)
    kind = random.randrange(12)
    if kind <= 2:
        return [random.choice([Step(b"R" + _pair(ra, dec, 4), 1), Step(b"r" + _pair(ra, dec, 8), 1)])]
    if kind == 3:
        return [random.choice([Step(b"S" + _pair(ra, dec, 4), 1), Step(b"s" + _pair(ra, dec, 8), 1)])]
    if kind == 4:
        az, alt = random.uniform(0.0, 360.0), random.uniform(-10.0, 90.0)
        return [random.choice([Step(b"B" + _pair(az, alt, 4), 1), Step(b"b" + _pair(az, alt, 8), 1)])]
    axis, sense = random.choice((16, 17)), random.randrange(2)
    if kind <= 6:
        return [Step(bytes((80, 2, axis, 36 + sense, random.choice((0, 1, 3, 5, 7, 9, 9, 10)), 0, 0, 0)), 0)]
    if kind == 7:
        rate = random.choice((0, 60, 600, 14400, 0xE000, 0xFFFD, 0xFFFE, 0xFFFF))
        return [Step(bytes((80, 3, axis, 6 + sense)) + rate.to_bytes(2) + bytes(2), 0)]
    if kind == 8:
        data = bytes((80, 4, axis, random.choice((2, 23, 4)))) + random.randbytes(3) + bytes(1)
        return [Step(data, 0)]
    if kind == 9:
        return [Step(b"M", 1), Step(bytes((80, 2, 16, 36, 0, 0, 0, 0)), 0), Step(bytes((80, 2, 17, 36, 0, 0, 0, 0)), 0)]
    if kind == 10:
        return [Step(bytes((84, random.choice((0, 1, 2, 3, 4)))), 1)]
    device = random.choice((16, 17, 18, 176, 178, 180, 0))
    asked = random.randbytes(3) + bytes((random.randrange(5),))
    return [Step(bytes((80, random.randrange(1, 5), device, random.randrange(256))) + asked, 0)]


def version(model: str) -> Step:
    """The question for the version: Sky-Watcher's hand control writes its three numbers as six digits."""
    return Step(b"V", 7 if model.startswith("synscan") else REPLIES["V"])


def nexstar(random: Random, judge: Judge, model: str, wild: bool, synced: bool) -> list[Step]:
    """What a program says next to a hand control of version 4.21."""
    kind = random.randrange(20)
    if kind < 9:
        steps = _nexstar_motion(random, judge)
    elif kind < 17:
        data = raw(random.choice(NEXSTAR_FORMS)[1])
        steps = [version(model) if data == b"V" else Step(data, 0 if data[:1] == b"P" else REPLIES[chr(data[0])])]
    else:
        steps = [Step(noise(random, raw(random.choice(NEXSTAR_FORMS)[1])), None)]
    return [
        step
        for step in steps
        if step.shapes is not None or wild or not SYNCS.match(step.data)
        if step.shapes is None or _wanted_frame(step.data, wild, synced)
    ]


def _wanted_frame(data: bytes, wild: bool, synced: bool) -> bool:
    """Of a whole command its beginning decides."""
    return wild or not (SITE_AND_CLOCK.match(data) or (not synced and SYNCS.match(data)))
