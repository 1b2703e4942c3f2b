"""A program that guides does not end what the owner does at the keypad, and its own motion does not end its guiding."""

from __future__ import annotations

import asyncio

import pytest

from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge, RehearsalClient
from tests.support.owner import Owner

#: Mounts of which a guide pulse ends, or changes, what their keys do.
MOUNTS = {
    "cge/4.21": ("nexstar", "cge", "4.21"), "cge/3.01": ("nexstar", "cge", "3.01"), "cpc": ("nexstar", "cpc", "4.21"),
    "avx": ("nexstar", "avx", "5.31"), "synscan": ("nexstar", "synscan", None), "lx200": ("lx200", "lx200", None),
    "lx200gps": ("lx200", "lx200gps", None), "onstep": ("lx200", "onstep", None),
}  # fmt: skip
#: The axis, what the owner presses and lets go, and the guide pulses of a program on this axis and the other.
KEYS = {
    "second": (2, "up", "let go", b":Mgn0500#", b":Mgw0500#"),
    "first": (1, "first on", "first let go", b":Mgw0500#", b":Mgn0500#"),
}


def bridge_to(name: str) -> Bridge:
    driven, model, version = MOUNTS[name]
    simulated = {"wedge": True} if name == "cpc" else None
    config = {"lowest": -90.0, "sun": 0.0}
    return Bridge(model, version, driven=driven, latency=0.05, config=config, simulated=simulated)


async def goto(client: RehearsalClient) -> None:
    """Go away from the pole, where a German mount begins, and wait for the end."""
    assert (await client.ask(b":Sr07:00:00#:Sd+50*00:00#:MS#", ending=b"0")).endswith(b"0")
    while await client.ask(b":D#") not in (b"#", b"       #"):
        client.send(b":GR#:GD#")
        await asyncio.sleep(0.3)


def dropped(bridge: Bridge) -> int:
    return sum("moved by hand" in entry.note for entry in bridge.entries)


@pytest.mark.parametrize("keys", list(KEYS))
@pytest.mark.parametrize("name", list(MOUNTS))
async def test_guide_pulse_does_not_end_a_motion_begun_at_the_keypad(name: str, keys: str) -> None:
    async with bridge_to(name) as bridge:
        client, owner = bridge.client(), Owner(bridge, MOUNTS[name][0])
        axis, press, release, pulse, _ = KEYS[keys]
        await goto(client)
        client.send(pulse)
        await asyncio.sleep(3.0)
        assert not dropped(bridge)
        if MOUNTS[name][0] == "lx200":
            bridge.sim.feed(b":RS#")  # the rate of its keypad
        owner.keys(press)
        for number in range(16):
            client.send(b":GR#:GD#")
            if number >= 4:
                client.send(pulse)
                truth = truth_of(bridge.sim)
                assert abs((truth.rate1, truth.rate2)[axis - 1]) > 0.1, number
            await asyncio.sleep(0.5)
        assert dropped(bridge) >= 8
        owner.keys(release)
        for _ in range(8):
            client.send(b":GR#:GD#")
            await asyncio.sleep(0.5)
        before = dropped(bridge)
        client.send(pulse)
        await asyncio.sleep(1.0)
        assert dropped(bridge) == before, "the owner has let go"


@pytest.mark.parametrize("keys", list(KEYS))
@pytest.mark.parametrize("name", ["cge/4.21", "synscan", "onstep"])
async def test_guide_pulse_runs_while_the_keypad_moves_the_other_axis(name: str, keys: str) -> None:
    async with bridge_to(name) as bridge:
        client, owner = bridge.client(), Owner(bridge, MOUNTS[name][0])
        _, press, _, _, other = KEYS[keys]
        await goto(client)
        owner.keys(press)
        for _ in range(8):
            client.send(b":GR#:GD#" + other)
            await asyncio.sleep(0.5)
        assert not dropped(bridge)


@pytest.mark.parametrize("name", list(MOUNTS))
async def test_guiding_program_is_not_taken_for_somebody_at_the_keypad(name: str) -> None:
    """Its own pulses in both directions, its arrows before them, and the end of its goto drop none of its pulses."""
    async with bridge_to(name) as bridge:
        client = bridge.client()
        for _ in range(20):
            client.send(b":GR#:GD#:Mgn0800#")
            await asyncio.sleep(0.3)
            client.send(b":GR#:GD#:Mgw0800#")
            await asyncio.sleep(0.9)
        client.send(b":RS#:Mw#")
        await asyncio.sleep(2.0)
        client.send(b":Qw#:GR#:GD#:Mgn0300#:Mge0300#")
        await asyncio.sleep(3.0)
        await goto(client)
        for _ in range(12):
            client.send(b":GR#:GD#:Mgn0200#:Mge0200#")
            await asyncio.sleep(0.25)
        assert not dropped(bridge)
