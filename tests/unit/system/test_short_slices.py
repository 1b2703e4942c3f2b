"""Short time slices are asked for where Linux grants them, and nothing else of the scheduling is changed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from gateway.system import short_slices

PROGRAM = """
import os
from gateway.system.short_slices import ask_for_short_slices
before = os.nice(3)
print(ask_for_short_slices(), os.nice(0) == before, os.sched_getscheduler(0) == os.SCHED_OTHER)
"""


@pytest.mark.skipif(not hasattr(os, "sched_getscheduler"), reason="not Linux")
def test_asking_for_short_time_slices_keeps_niceness_and_policy() -> None:
    said = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True).stdout
    assert said in ("True True True\n", "False True True\n")


def test_short_time_slices_are_not_requested_on_an_unknown_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(short_slices.platform, "machine", lambda: "z80")
    assert not short_slices.ask_for_short_slices()
