"""``:Sw`` is a speed: what the motor turns at, asked of the simulated mount's axes."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

#: Model, version, and the most that its motors do, degrees a second.
MOUNTS = [
    ("cpc", "4.21", 5.0),
    ("cge", "4.21", 5.0),
    ("slt", "4.03", 5.0),
    ("avx", "5.31", 4.0),
    ("nexstar-gps", "2.2", 4.0),
    ("gt", "104.0", 3.0),
]


def turns(mount: tuple[str, str, float], commands: bytes, surface: str = "lx200gps") -> tuple[float, list[bytes]]:
    """Degrees a second of the second axis three seconds after a motion south has begun; and what was sent for it."""

    async def program() -> tuple[float, list[bytes]]:
        async with Bridge(*mount[:2], surface=surface, config={"lowest": -90.0, "sun": 0.0}) as bridge:
            before = len(bridge.sent_requests())
            client = bridge.client()
            client.send(commands)
            await asyncio.sleep(3)
            speed = abs(truth_of(bridge.sim).rate2)
            sent = [one for one in bridge.sent_requests()[before:] if one[:1] == b"P" and one[2] == 17]
            client.send(b":Q#")
            await asyncio.sleep(3)
            return speed, sent

    found: list[tuple[float, list[bytes]]] = []

    async def keep() -> None:
        found.append(await program())

    run(keep())
    return found[0]


@pytest.mark.parametrize("mount", MOUNTS, ids=lambda mount: "/".join(mount[:2]))
@pytest.mark.parametrize("fastest", [2, 3, 4, 8])
def test_arrow_runs_at_the_fastest_rate_that_was_set(mount: tuple[str, str, float], fastest: int) -> None:
    speed, _ = turns(mount, b":Sw%d#:Ms#" % fastest)
    assert speed == pytest.approx(min(fastest, mount[2]), rel=0.1)


@pytest.mark.parametrize(
    ("rate", "degrees"), [(b":RC#", 8 * 15.041 / 3600.0), (b":RM#", 1.0), (b":RS#", 5.0), (b":RE02.0#", 2.0)]
)
def test_lx200_rates_equal_the_key_rates_of_a_cge(rate: bytes, degrees: float) -> None:
    """Keys 4, 7 and 9 of a CGE: 8 times sidereal, 1 and 5 degrees a second."""
    assert turns(MOUNTS[1], rate + b":Ms#")[0] == pytest.approx(degrees, rel=0.1)


@pytest.mark.parametrize(
    ("mount", "commands", "words"),
    [
        (MOUNTS[0], b":Sw8#:Ms#", "a motion at 8 degrees a second is done at 5:"),
        (MOUNTS[0], b":RE08.0#:Ms#", "a motion at 8 degrees a second is done at 5:"),
        (MOUNTS[5], b":Sw4#:RE04.0#:Ms#", "a motion at 4 degrees a second is done at 3:"),
        (MOUNTS[0], b":Sw4#:Ms#", ""),
        (MOUNTS[0], b":RS#:Ms#", ""),
        (MOUNTS[0], b":RE01.5#:Ms#", ""),
    ],
    ids=ascii,
)
async def test_unavailable_fastest_rate_is_reported_once(
    mount: tuple[str, str, float], commands: bytes, words: str
) -> None:
    async with Bridge(*mount[:2], surface="lx200gps", config={"lowest": -90.0, "sun": 0.0}) as bridge:
        for _ in range(2):
            client = bridge.client()
            client.send(commands)
            await asyncio.sleep(2)
            client.send(b":Q#")
            await asyncio.sleep(2)
        told = [one.text for one in bridge.wire_log.recent_notices if "a motion at" in one.text]
        assert [text[: len(words)] for text in told] == ([words] if words else [])


def test_fastest_rate_below_the_maximum_is_sent_as_a_variable_rate() -> None:
    """A quarter of an arcsecond a second: 2 degrees are 28800 = 70 80 hex, behind 16 (axis 2 is 17), 6 or 7."""
    (sent, *_) = turns(MOUNTS[0], b":Sw2#:Ms#")[1]
    assert sent in (bytes((80, 3, 17, 6, 0x70, 0x80, 0, 0)), bytes((80, 3, 17, 7, 0x70, 0x80, 0, 0)))
    (sent, *_) = turns(MOUNTS[0], b":Sw8#:Ms#")[1]
    assert sent in (bytes((80, 2, 17, 36, 9, 0, 0, 0)), bytes((80, 2, 17, 37, 9, 0, 0, 0)))


@pytest.mark.parametrize("chosen", [b":RE04.0#:Sw2#", b":Sw2#:RE04.0#", b":Sw2#:RG#:RS#"])
def test_fastest_rate_limits_a_separate_axis_rate(chosen: bytes) -> None:
    assert turns(MOUNTS[0], chosen + b":Ms#")[0] == pytest.approx(2.0, rel=0.05)


def test_slower_rates_are_not_raised_to_the_fastest_rate() -> None:
    assert turns(MOUNTS[0], b":Sw4#:RE01.5#:Ms#")[0] == pytest.approx(1.5, rel=0.05)
    assert turns(MOUNTS[0], b":Sw4#:RM#:Ms#")[0] == pytest.approx(1.0, rel=0.05)
