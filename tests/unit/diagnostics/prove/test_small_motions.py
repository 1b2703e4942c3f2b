"""Mounts that differ on purpose: what differs is found and named, or told as not measurable."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import pytest

from gateway.core import requests
from gateway.core.operations import Direction
from gateway.diagnostics.prove import small_motions
from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, SAME, Findings
from gateway.diagnostics.prove.telescope import CLIENT, MAX_UNCHANGED_TIME, CheckedMount
from tests.support.prove_setup import Onlooker, Proven, run_calm


def _moves(proven: Proven, change: Callable[[int, float], float]) -> None:
    """Let the motors turn at other rates than they are told."""
    mechanics = proven.sim.mechanics
    move = mechanics.move
    mechanics.move = lambda now, axis, rate, **more: move(now, axis, change(axis, rate), **more)  # type: ignore[method-assign]


def other_rates(proven: Proven) -> None:
    _moves(proven, lambda axis, rate: 0.7 * rate)


def north_reversed(proven: Proven) -> None:
    _moves(proven, lambda axis, rate: -rate if axis == 2 else rate)


def _late(proven: Proven, which: Callable[[bytes], bool], seconds: float) -> None:
    """Let some commands reach the mount later."""
    write, loop = proven.wire.write, asyncio.get_running_loop()

    def late(data: bytes) -> None:
        if which(data):
            loop.call_later(seconds, write, data)
        else:
            write(data)

    proven.wire.write = late  # type: ignore[method-assign]


def runs_on(proven: Proven) -> None:
    """A stop takes effect after 2.5 s, in which the mount has moved five degrees at 2 degrees a second."""
    _late(proven, lambda data: data.startswith(b":Q"), 2.5)


def clock_wrong(proven: Proven) -> None:
    proven.sim.mechanics.sky = proven.sim.mechanics.sky._replace(clock_ahead=5400.0)


def site_wrong(proven: Proven) -> None:
    proven.sim.mechanics.sky = proven.sim.mechanics.sky._replace(longitude=-110.0)


def nothing(proven: Proven) -> None:
    pass


def other_altitudes(proven: Proven) -> None:
    """What the server tells is not what is calculated from its position; and its steps are finer than those of a hand
    control, so that pulses show."""
    proven.sim.answers["altitude"] = 7.0  # type: ignore[attr-defined]


def busy_classic(proven: Proven) -> None:
    """It takes two seconds for each tenth answer."""
    count = iter(range(1, 10**6))
    _late(proven, lambda data: data.startswith(b":G") and next(count) % 10 == 0, 2.0)


#: By difference: the mount, its change, further settings, the answers, what is found with which verdict, and its keys.
DIFFERENCES: dict[str, tuple[str, Callable[[Proven], None], dict[str, Any], str, dict[str, str], set[str]]] = {
    "other rates": ("nexstar:6-8se", other_rates, {}, "ssyssss", {"rate 6 north/south": DIFFERS}, {"rates"}),
    "north reversed": (
        "nexstar:cgem", north_reversed, {}, "ssyyssss",
        {"direction of north and south": DIFFERS, "direction of west and east": SAME}, set()),
    "a run-on of 5 degrees": ("lx200:autostar", runs_on, {}, "ssyssss", {"run-on after a stop": DIFFERS}, {"run-on"}),
    "a slow line": (
        "nexstar:6-8se", nothing, {"latency": 0.5}, "ysysy",
        {"reply times": DIFFERS, "guiding": NOT_MEASURABLE, "direction of north and south": SAME}, set()),
    "a wrong clock": ("nexstar:6-8se", clock_wrong, {}, "sysssss", {"the mount and this computer": DIFFERS}, set()),
    "a wrong site": (
        "lx200:lx200gps", site_wrong, {}, "sysssss", {"altitude and azimuth against RA and Dec": DIFFERS}, set()),
    "a server's altitudes": (
        "alpaca:german", other_altitudes, {}, "syyssyss",
        {"altitude and azimuth against RA and Dec": DIFFERS, "guiding west/east": SAME}, set()),
    "a dialect that it was not told of": (
        "lx200:onstep", nothing, {"config": {"at": "lx200:autostar@sim"}}, "yssssss",
        {"answers to its protocol's questions": DIFFERS}, set()),
    "a busy classic": ("lx200:lx200", busy_classic, {}, "yssssss",
        {"reply times": DIFFERS}, set()),
}  # fmt: skip


def _checked(what: str, **config: object) -> tuple[Findings, dict[str, str]]:
    mount, change, settings, answers, _, _ = DIFFERENCES[what]

    async def play() -> tuple[Findings, dict[str, str]]:
        more = settings | {"config": settings.get("config", {}) | config}
        async with Proven(mount, every=9.0, change=change, **more) as proven:
            with patch.object(small_motions, "RATE_KEYS", (9, 6)):
                found = await proven.check(person := Onlooker(answers))
            print(*person.said, sep="\n")
            return found, {one.what: one.verdict for stage in found.stages.values() for one in stage}

    result: tuple[Findings, dict[str, str]] = run_calm(play())
    return result


@pytest.mark.parametrize("what", DIFFERENCES)
def test_prove_reports_each_simulated_deviation_of_a_mount(what: str) -> None:
    *_, expected, keys = DIFFERENCES[what]
    found, verdicts = _checked(what)
    assert {name: verdicts.get(name) for name in expected} == expected, verdicts
    assert found.config_keys.keys() == keys
    differs = {one.what for one in found.select(DIFFERS)}
    assert differs <= {*expected, "rate 6 west/east", "rates of all keys", "answers to its protocol's questions"}, (
        differs
    )
    assert all(one.means for one in found.select(DIFFERS))


@pytest.mark.parametrize("what", ["other rates", "a run-on of 5 degrees"])
def test_prove_finds_no_difference_once_the_gateway_is_adapted(what: str) -> None:
    found, _ = _checked(what)
    again, verdicts = _checked(what, **{key.replace("-", "_"): value for key, value in found.config_keys.items()})
    assert not again.config_keys and verdicts["run-on after a stop"] == SAME
    assert not again.select(DIFFERS)


@pytest.mark.parametrize("mount", ["nexstar:6-8se", "lx200:autostar", "alpaca:polar"])
def test_prove_soon_stops_testing_a_motor_that_does_not_turn(mount: str) -> None:
    """Its drive is off, so that the sky passes and its right ascension changes all the time."""

    async def play() -> None:
        async with Proven(mount, change=lambda proven: _moves(proven, lambda *_: 0.0)) as proven:
            await proven.gateway.carry_out(requests.TrackRequest(on=False, who=CLIENT))
            await asyncio.sleep(5.0)
            telescope = CheckedMount(proven.gateway)
            telescope.begin_stage()
            motion = await telescope.move_by_key(Direction.NORTH, 9, 10.0)
            assert MAX_UNCHANGED_TIME <= motion.ended_at - motion.began_at < MAX_UNCHANGED_TIME + 1.0

    run_calm(play())


@pytest.mark.parametrize("mount", ["nexstar:6-8se", "lx200:autostar", "lx200:lx200"])
def test_prove_does_not_judge_pulses_timed_by_a_busy_computer(mount: str) -> None:
    """They are as long as it takes until it gets to end them."""

    async def play() -> None:
        async with Proven(mount, every=9.0) as proven:
            person = Onlooker("ssssysss")
            person.when["pulses west"] = lambda: setattr(proven.loop, "late", 0.12)
            found = await proven.check(person)
            proven.loop.late = 1e-5
            print(*person.said, sep="\n")
            verdicts = {one.what: one.verdict for one in found.stages["guiding"]}
            assert "guiding west/east" in verdicts and DIFFERS not in verdicts.values(), verdicts

    run_calm(play())
