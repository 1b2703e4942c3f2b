"""An evening of an LX200 program at every kind of hand control: the gateway makes up for what its version lacks."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.evening import LOWEST, NORTH, SOUTH, STEPS, Play, play
from tests.support.in_process_gateway import Bridge
from tests.support.typed_programs import face

#: Model, version, and what the user must say because the hand control cannot.
MOUNTS: list[tuple[str, str, dict[str, Any]]] = [
    ("nexstar-gps", "1.2", {"site": NORTH, "mode": "alt-az"}), ("nexstar-gps", "1.6", {"mode": "alt-az"}),
    ("i-series", "2.2", {"site": NORTH, "mode": "alt-az"}), ("cge", "3.02", {}), ("slt", "4.10", {}),
    ("gt", "104.0", {}), ("cpc", "4.21", {}), ("cgem", "5.31", {}), ("avx", "5.31", {}), ("evolution", "5.31", {}),
    ("6-8se", "starsense-1.20", {}),
]  # fmt: skip
#: This version moves by small gotos, which `safety/test_by_hand.py` tests: it has no pass-through.
OTHERWISE = {"1.2": {"arrows", "pulses", "tracking"}}


@pytest.mark.parametrize("south", [False, True], ids=["north", "south"])
@pytest.mark.parametrize(("model", "version", "config"), MOUNTS, ids=[f"{m} {v}" for m, v, _ in MOUNTS])
def test_hand_control_of_every_version_obeys_an_lx200_program(
    model: str, version: str, config: dict[str, Any], south: bool
) -> None:
    async def program() -> dict[str, str]:
        site = SOUTH if south else NORTH
        settings: dict[str, Any] = {"lowest": LOWEST, "sun": 0.0, "guide_directions": "sky", **config}
        settings |= {"site": site} if "site" in config else {}
        async with Bridge(model, version, site=site, config=settings, latency=0.1) as bridge:
            return await play(Play(bridge, face("lx200", bridge), "nexstar"), STEPS)

    found = run(program())
    wrong = {step: words for step, words in found.items() if words.startswith(("wrong", "refused: "))}
    assert wrong.keys() == OTHERWISE.get(version, set()) & wrong.keys(), wrong
