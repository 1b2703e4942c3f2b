"""Motors need a second to their speed and a second back: no limit is crossed for it. Judged by the physical truth."""

from __future__ import annotations

import asyncio

import pytest

from gateway.diagnostics.virtual_time import run
from gateway.mount.safety.allow import max_rate
from tests.support.in_process_gateway import Bridge
from tests.support.truth import sampled

#: What a place is known to, and a mount at rest may differ by while it tracks, degrees.
JITTER = 0.02


def lowest_reached(model: str, driven: str, lowest: float, latency: float, words: bytes) -> float:
    """A program holds an arrow and shows life -> how low the tube came."""
    seen: list[float] = []

    async def program() -> None:
        async with Bridge(model, driven=driven, latency=latency, config={"lowest": lowest}) as bridge:
            client = bridge.client()
            client.send(words)
            async with sampled(bridge.sim, lambda truth: seen.append(truth.altitude)):
                for _ in range(60):
                    client.send(b":GR#")
                    await asyncio.sleep(0.1)
                assert not bridge.controller.moving

    run(program())
    return min(seen)


@pytest.mark.parametrize(
    ("model", "driven", "lowest", "latency"),
    [
        ("lx200", "lx200", 35.8, 0.02),  # the second look comes while it still gathers speed: 1 degree beyond, before
        ("lx200gps", "lx200", 33.4, 0.1),
        ("6-8se", "nexstar", 40.0, 0.02),
        ("cge", "nexstar", 44.2, 0.25),  # from the pole: it falls faster and faster, 0.24 degrees beyond, before
        ("cge", "nexstar", 41.8, 0.02),
    ],
)
def test_arrow_at_full_speed_ends_before_the_limit(model: str, driven: str, lowest: float, latency: float) -> None:
    assert lowest_reached(model, driven, lowest, latency, b":RS#:Ms#") >= lowest - JITTER


def test_arrow_at_full_speed_is_stopped_no_earlier_than_needed() -> None:
    """Four degrees and a half a second from 45: a look in half a second, and a way of half a second to rest."""
    assert lowest_reached("6-8se", "nexstar", 30.0, 0.02, b":RS#:Ms#") < 30.0 + 4.6 * 1.5


@pytest.mark.parametrize(
    ("change", "now", "elapsed", "reckoned"),
    [
        (0.5, 10.5, 0.5, 4.0),  # half a second after it began: a degree a second so far, and four it was told
        (0.04, 10.5, 0.5, 0.08),  # a way past the limit
        (2.0, 12.0, 0.5, 4.0),  # later what is seen is all of it
        (0.5, 12.0, 0.5, 1.0),
    ],
)
def test_safety_reckons_with_the_ordered_rate_while_motors_gather_speed(
    change: float, now: float, elapsed: float, reckoned: float
) -> None:
    assert max_rate(change / elapsed, None, 4.0, now - elapsed - 10.0, now - 10.0) == pytest.approx(reckoned)


@pytest.mark.parametrize(
    ("rate", "earlier", "reckoned"), [(0.5, None, 0.5), (1.5, 0.5, 2.5), (1.0, 1.5, 1.0), (3.0, None, 3.0)]
)
def test_safety_expects_a_growing_rate_to_keep_growing(rate: float, earlier: float | None, reckoned: float) -> None:
    assert max_rate(rate, earlier, 0.0, 5.0, 6.0) == pytest.approx(reckoned)
