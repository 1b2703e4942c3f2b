"""Detects a computer whose clock may be wrong: a board without a clock battery that no time server has set.

Linux shows whether its clock is synchronised (adjtimex); a board is recognised by its device tree. Other computers, and
virtual machines and containers, keep the time while off or get it from their host: their clocks are not doubted.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time
from pathlib import Path

#: The state of the kernel's clock, and the bit of its status, that mean "not synchronised" (linux/timex.h).
_CLOCK_ERROR_STATE, _UNSYNCHRONISED_BIT = 5, 0x40
#: Seconds between two checks whether the kernel's clock is synchronised.
_CHECK_PERIOD = 60.0


class _Timex(ctypes.Structure):
    """The first fields of ``struct timex``; ``rest`` is large enough for all others on every architecture."""

    _fields_ = [
        ("modes", ctypes.c_uint), ("offset", ctypes.c_long), ("freq", ctypes.c_long), ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long), ("status", ctypes.c_int), ("rest", ctypes.c_long * 64),
    ]  # fmt: skip


def lacks_hardware_clock(root: Path = Path("/")) -> bool:
    """Whether this is a board with a device tree and without a hardware clock, such as a Raspberry Pi before the 5."""
    models = (root / name for name in ("proc/device-tree/model", "sys/firmware/devicetree/base/model"))
    # os.path, because a container may forbid access, and a container keeps the time of its host
    return any(map(os.path.exists, models)) and not any((root / "dev").glob("rtc*"))


def is_clock_synchronised() -> bool | None:
    """Whether the kernel reports that its clock is synchronised with a time source; None if unknown."""
    if sys.platform != "linux":
        return None
    try:
        state = _Timex()
        result = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(state))
    except (OSError, AttributeError):
        return None
    return None if result < 0 else not (result == _CLOCK_ERROR_STATE or state.status & _UNSYNCHRONISED_BIT)


class ClockCheck:
    """Returns, when called, whether this computer's clock may be wrong. It asks the kernel once a minute at most."""

    def __init__(self, root: Path = Path("/")) -> None:
        self._lacks_hardware_clock = sys.platform == "linux" and lacks_hardware_clock(root)
        self._checked_at, self._is_unreliable = float("-inf"), False

    def __call__(self) -> bool:
        if self._lacks_hardware_clock and time.monotonic() - self._checked_at > _CHECK_PERIOD:
            self._checked_at, self._is_unreliable = time.monotonic(), is_clock_synchronised() is False
        return self._is_unreliable
