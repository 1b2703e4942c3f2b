"""``Mount``: the same methods, checks, answers and errors, whether the gateway is in this process or in another.

Both are played on virtual time: one request is handed over as it is, the other as the text that a datagram carries.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import numpy
import pytest

from gateway import BelowHorizon, Fault, Held, Invalid, Mount, NoAnswer, Stopped, SyncTooFar, Unsupported, UserError, op
from gateway.app.api.opening import mount_in_process
from gateway.app.control.operations import answer_type
from gateway.app.status import State, StatusLine
from gateway.astro.spherical import wrap180
from gateway.core import requests
from gateway.diagnostics.virtual_time import run
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.in_process_gateway import here as at_once

WAYS = ("in this process", "from another process")
SETTINGS = {"lowest": -90.0, "sun": 0.0, "dead_man": 5.0}


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(autouse=True)
def no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.app.control.requests.asyncio.to_thread", at_once)


@asynccontextmanager
async def opened(way: str, folder: Path, **config: Any) -> AsyncIterator[tuple[Mount, Bridge]]:
    """A gateway over a simulated mount that has answered, and the mount as a program has it."""
    async with Bridge(state=folder, config=SETTINGS | config) as bridge:

        async def send(wish: requests.Request, _: float) -> requests.Answer:
            answer = await bridge.gateway.carry_out(requests.decode(requests.encode(wish)))
            return msgspec.json.decode(msgspec.json.encode(answer), type=requests.Answer)

        mount = mount_in_process(bridge.gateway) if way == WAYS[0] else Mount("pier", send, "a program")
        await mount.ready()
        yield mount, bridge


def near(there: tuple[float, float], ra: float, dec: float) -> bool:
    """Whether a position is another one; right ascension begins again at 360 degrees."""
    return abs(wrap180(there[0] - ra)) < 0.05 and abs(there[1] - dec) < 0.05


async def test_python_program_points_a_mount(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, _):
        ra, dec = await mount.position()
        await mount.goto(ra + 20.0 - 360.0, dec)
        assert await mount.moving() and (await mount.status()).look.slewing
        assert near(await mount.arrived(), ra + 20.0, dec)
        await mount.sync(ra + 21.0, dec)
        assert near(await mount.position(), ra + 21.0, dec)
        assert not await mount.moving()
        assert (await mount.status()).product == "Celestron NexStar"
        site, status = await mount.site(), await mount.perform(op.GetStatus())
        assert isinstance(site, op.Place) and isinstance(status, op.Status) and status.aligned
        assert isinstance((await mount.time()).unix, float)


async def test_catalogue_position_is_taken_as_j2000(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, _):
        there = await mount.perform(op.ToEquinoxOfDate(20.0, 60.0))
        assert abs(there.ra - 20.0) > 0.2
        await mount.goto(20.0, 60.0, j2000=True)
        assert near(await mount.arrived(), there.ra, there.dec)
        await mount.sync(21.0, 60.5, j2000=True)
        assert near(await mount.position(), there.ra + 1.0, there.dec + 0.5)


async def test_python_api_goes_to_objects_parks_moves_and_holds(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, bridge):
        await mount.goto_object("Polaris")
        polaris = await mount.perform(op.ToEquinoxOfDate(37.95, 89.26))
        assert abs((await mount.arrived())[1] - polaris.dec) < 0.05
        await mount.park()
        await mount.arrived()
        activity = await mount.perform(op.GetActivity())
        assert activity.parked and not activity.goto and not bridge.sim.tracking
        await mount.unpark()
        assert bridge.sim.tracking
        before = await mount.perform(op.HorizontalPosition())
        await mount.move(op.Direction.NORTH, 9, 1.0)
        assert (await mount.perform(op.HorizontalPosition())).alt > before.alt + 1.0
        await mount.hold()
        with pytest.raises(Held, match="mount-gateway stop --release"):
            await mount.goto(20.0, 80.0)
        await mount.release()
        await mount.goto(20.0, 80.0)
        await mount.stop()
        assert not await mount.moving()


async def test_python_api_raises_the_matching_error_for_a_refusal(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path, lowest=20.0) as (mount, _):
        ra, dec = await mount.position()
        refused: list[tuple[Coroutine[Any, Any, None], type[Exception], str]] = [
            (mount.goto(10.0, -80.0), BelowHorizon, "20"),
            (mount.sync(ra + 90.0, dec), SyncTooFar, "Sync refused"),
            (mount.sync(ra, 91.0), Invalid, "declination must be a number of degrees from -90 to 90, not 91"),
            (mount.goto_object("Vegaa"), UserError, "did you mean Vega"),
            (mount.goto_object(42), Invalid, "Named: name: Expected `str`"),  # type: ignore[arg-type]
            (mount.move("up", 9, 1.0), Invalid, "write op.Direction.NORTH"),  # type: ignore[arg-type]
            (mount.move(op.Direction.NORTH, 9, 99.0), Invalid, "for up to 5 s"),
        ]
        for wrong in (float("nan"), float("inf"), "05:34:32", None):
            refused += [(mount.goto(wrong, 10.0), Invalid, "right ascension must be a number")]  # type: ignore[arg-type]
        for call, error, words in refused:
            with pytest.raises(error, match=words):
                await call
        with pytest.raises(Unsupported, match="two sides of the pier"):
            await mount.perform(op.TubeSide())
        assert not [line for line in (await mount.status()).lately if "pier" in line]  # a question is no order
        assert await mount.arrived()  # without a goto of its own, at once


@each(
    ("operation", "words"),
    [
        ("goto", "'goto' is not an operation"),
        (op.Position, "is not an operation"),
        (op.MoveAxis(1.0, 1, op.Rate("find")), "MoveAxis: axis: Expected `int`, got `float`."),  # type: ignore[arg-type]
        (op.SetTracking("no"), "SetTracking: on: Expected `bool`, got `str`."),  # type: ignore[arg-type]
        (op.Pulse("up", 100), "Pulse: direction: Invalid enum value 'up'; write op.Direction.NORTH."),  # type: ignore[arg-type]
        (op.Move(op.Direction.NORTH, 5), "write op.Rate(key=5)."),  # type: ignore[arg-type]
        (op.SetGuideRate(1, 5.0), "The guide rate must be from 0 to 1, a fraction of sidereal, not 5."),
        (op.Pulse(op.Direction.NORTH, -500), "The duration of a pulse must not be negative, as -500 is."),
        (op.SetSite(), "A site needs a latitude, a longitude, or both."),
        (op.PlanetPlace("Jupitr"), "There is no planet 'Jupitr'; write Mercury, Venus, "),
        (op.SetClock(1e30, 0.0), "The clock of this mount takes the years"),
    ],
)
async def test_unknown_operation_is_refused_in_a_sentence(operation: Any, words: str, tmp_path: Path) -> None:
    for way in WAYS:
        async with opened(way, tmp_path) as (mount, _):
            with pytest.raises(Invalid) as caught:
                await mount.perform(operation)
            assert words in str(caught.value)


@pytest.mark.parametrize(
    ("name", "fields", "words"),
    [
        ("Fly", {}, "no operation 'Fly'"),
        ("Operation", {}, "no operation 'Operation'"),
        ("Goto", {"ra": 1.0}, "Goto: "),
        ("Goto", {"ra": 1.0, "dec": 91.0}, "declination must be a number"),
        ("Pulse", {"direction": "n", "ms": -5}, "must not be negative"),
    ],
)
async def test_gateway_refuses_invalid_operation_names_and_values(
    name: str, fields: dict[str, Any], words: str, tmp_path: Path
) -> None:
    async with opened(WAYS[1], tmp_path) as (_, bridge):
        answer = await bridge.gateway.carry_out(requests.OperationRequest(operation=name, fields=fields))
        assert not answer.is_ok and answer.fault == "Invalid" and words in answer.text


def test_every_read_gives_the_same_answer_in_process_and_from_another(tmp_path: Path) -> None:
    kinds = [kind for name in dir(op) if (kind := op.operation_class(name)) is not None]
    for kind in kinds:
        msgspec.json.Decoder(answer_type(kind))  # every answer has a type that JSON can carry
    answers: dict[str, list[Any]] = {}

    async def program(way: str) -> None:
        async with opened(way, tmp_path) as (mount, _):
            for kind in kinds:
                if issubclass(kind, op.Read) and len(kind.__struct_defaults__) == len(kind.__struct_fields__):
                    try:
                        answer: object = await mount.perform(kind())
                    except Fault as fault:
                        answer = type(fault), str(fault)
                    answers.setdefault(kind.__name__, []).append(answer)

    for way in WAYS:
        run(program(way))
    assert len(answers) > 12
    assert all(type(one) is type(other) for one, other in answers.values())
    steady = ("GetIdentity", "GetAbilities", "GetSite", "GetStatus", "TubeSide", "PierSide", "HomeState", "Slewing")
    assert all(answers[name][0] == answers[name][1] for name in steady)


async def test_numbers_of_numpy_and_similar_libraries_are_accepted(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, _):
        await mount.position()
        await mount.goto(numpy.float32(20.0), numpy.int64(10))  # type: ignore[arg-type]
        await mount.stop()  # what is asked after it is not ended by it
        await mount.perform(op.Move("n", op.Rate(key=numpy.int8(2))))  # type: ignore[arg-type]
        assert await mount.moving()


async def test_arrow_motion_lasts_while_its_program_sends_requests(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, bridge):
        await mount.perform(op.Move(op.Direction.EAST, op.Rate(key=5)))
        for _ in range(100):  # so many others come and go meanwhile
            await bridge.gateway.carry_out(requests.GotoRequest(where=requests.Spot(400.0, 0.0)))
            await asyncio.sleep(0.2)
            await mount.position()
        assert (await mount.status()).look.by_hand
        await asyncio.sleep(12.0)
        assert not (await mount.status()).look.by_hand


async def ask(bridge: Bridge, frames: bytes) -> None:
    """Send frames as another program, and let them be carried out."""
    bridge.client().send(frames)
    await asyncio.sleep(1.0)


async def _stop(mount: Mount, bridge: Bridge) -> None:
    await mount.stop()


async def _abort(mount: Mount, bridge: Bridge) -> None:
    await mount.perform(op.AbortMotion())


async def _end_goto(mount: Mount, bridge: Bridge) -> None:
    await mount.perform(op.AbortSlew())


async def _other_stop(mount: Mount, bridge: Bridge) -> None:
    await ask(bridge, b":Q#")


async def _other_goto(mount: Mount, bridge: Bridge) -> None:
    await ask(bridge, b":Sr02:00:00#:Sd+70*00:00#:MS#")


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (_stop, r"stopped on the way by .*program.*, at \d"),
        (_abort, r"stopped on the way by .*program.*, at \d"),
        (_end_goto, "the goto ended .* degrees from its goal"),
        (_other_stop, r"stopped on the way by 127\.0\.0\.1, at \d"),
        (_other_goto, r"another goto came from 127\.0\.0\.1, at \d"),
    ],
)
async def test_goto_that_ended_before_anybody_waited_is_reported(
    end: Callable[[Mount, Bridge], Awaitable[None]], words: str, way: str, tmp_path: Path
) -> None:
    async with opened(way, tmp_path) as (mount, bridge):
        for _ in range(2):
            await mount.goto(20.0, 80.0)
            await asyncio.sleep(1.0)
            await end(mount, bridge)
            for _ in range(2):
                with pytest.raises(Stopped, match=words):
                    await mount.arrived()


async def test_program_waiting_for_arrival_is_told_of_a_stop(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, bridge):
        await mount.perform(op.Goto(20.0, 80.0))
        with pytest.raises(TimeoutError, match=r"within 0\.5 s; it goes on"):
            await mount.arrived(0.5)
        waiting = asyncio.ensure_future(mount.arrived())
        await asyncio.sleep(1.0)
        assert not waiting.done()
        await ask(bridge, b":Q#")
        with pytest.raises(Stopped):
            await waiting


async def test_program_can_wait_for_another_programs_goto_after_its_own(way: str, tmp_path: Path) -> None:
    async with opened(way, tmp_path) as (mount, bridge):
        ra, dec = await mount.position()
        await mount.goto(ra + 1.0, dec)
        await mount.arrived()
        await mount.stop()  # this is no end of the goto
        assert near(await mount.arrived(), ra + 1.0, dec)
        await ask(bridge, b":Sr02:00:00#:Sd+70*00:00#:MS#")
        assert near(await mount.arrived(), 30.0, 70.0)


async def test_stop_during_a_name_lookup_cancels_the_goto(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def slowly(function: Callable[..., Any], *arguments: Any) -> Any:
        await asyncio.sleep(1.0)
        return function(*arguments)

    async with opened(way, tmp_path) as (mount, _):
        monkeypatch.setattr("gateway.app.control.requests.asyncio.to_thread", slowly)
        going = asyncio.ensure_future(mount.goto_object("Polaris"))
        await asyncio.sleep(0.1)
        await mount.stop()
        with pytest.raises(Stopped):
            await going
        assert not await mount.moving()


async def test_waiting_for_a_goto_ends_early_when_the_mount_is_lost() -> None:
    lost = State(StatusLine("pier", "down", "no such port", unknown=True), "nexstar@sim")

    async def send(wish: requests.Request, _: float) -> requests.Answer:
        match wish:
            case requests.StateRequest():
                return requests.Answer(requests.DONE, msgspec.json.encode(lost).decode())
            case requests.ProgressRequest():
                return requests.Answer(requests.UNDER_WAY, "")
        return requests.Answer(requests.DONE, "null")

    mount = Mount("pier", send, "a program")
    await mount.goto(20.0, 80.0)
    with pytest.raises(TimeoutError, match=r"within 0\.5 s, .* not known"):
        await mount.arrived(0.5)
    with pytest.raises(NoAnswer, match=r"not known .*: no such port"):
        await mount.arrived()
    with pytest.raises(NoAnswer, match="not known whether the mount moves"):
        await mount.moving()
    with pytest.raises(NoAnswer, match=r"pier has not answered within 3 s"):
        await mount.ready(3.0)
