"""A gateway that runs already, asked from Python: the same requests as from the shell, the same errors as inside."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway import (
    BelowHorizon,
    BlockingConnectedGateway,
    ConnectedGateway,
    Held,
    Invalid,
    NoAnswer,
    Stopped,
    SyncTooFar,
    UserError,
    connect,
    connect_blocking,
    open_blocking_gateway,
    open_gateway,
)
from gateway.app.api import arrival, connected
from gateway.app.control.exchange import ControlEndpoint
from gateway.app.control.orders import LONGEST
from gateway.app.control.reach import ANSWERED
from gateway.app.status import OLD_AFTER, State, StatusLine
from gateway.astro.spherical import wrap180
from gateway.core import requests
from gateway.core.operations import Direction, Equatorial
from tests.support.cable import Cable
from tests.support.process import PATIENCE

SIM: dict[str, Any] = {"lowest": -90, "sun": 0, "speed": 8}


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    monkeypatch.setattr(connected, "LOOK", 0.05)


@asynccontextmanager
async def running(**settings: Any) -> AsyncIterator[ConnectedGateway]:
    async with open_gateway("nexstar@sim", **{**SIM, **settings}) as gateway:
        await gateway.ready()
        yield connect()


def near(there: tuple[float, float], ra: float, dec: float) -> bool:
    """Whether a position is another one; right ascension begins again at 360 degrees."""
    return abs(wrap180(there[0] - ra)) < 0.05 and abs(there[1] - dec) < 0.05


def play(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


def test_a_goto_arrives_where_it_was_sent() -> None:
    async def work() -> None:
        async with running() as mount:
            ra, dec = await mount.position()
            await mount.goto(ra + 2.0, dec)
            assert (await mount.status()).look.moves
            assert near(await mount.arrived(60.0), ra + 2.0, dec)
            state = await mount.status()
            assert state.look.position is not None and state.product == "Celestron NexStar"
            await mount.sync(ra + 3.0, dec)
            assert near(await mount.position(), ra + 3.0, dec)

    play(work())


def test_every_request_reaches_the_mount() -> None:
    async def work() -> None:
        async with running(name="pier") as mount:
            assert mount.name == "pier" and connect("pier").name == "pier"
            assert await mount.ask(requests.Track(on=False)) == "tracking is off"
            await mount.ask(requests.TellSite(50.0, 10.0))
            await mount.ask(requests.TellTime(1.8e9, 1.0))
            async with asyncio.timeout(PATIENCE):
                for kept in ("the site that was set is kept in the gateway", "the clock that was set is kept"):
                    while kept not in " ".join((await mount.status()).lately):
                        await asyncio.sleep(connected.LOOK)
            await mount.ask(requests.Move(Direction.NORTH, 9, 0.2))
            await mount.goto_object("Capella")
            await mount.park()
            await mount.stop()
            assert not (await mount.status()).look.moves
            await mount.ask(requests.Unpark())

    play(work())


def test_what_is_refused_is_the_error_that_it_is() -> None:
    async def work() -> None:
        async with running(lowest=20) as mount:
            with pytest.raises(BelowHorizon, match="lower than the 20 degrees that are allowed"):
                await mount.goto(10.0, -80.0)
            ra, dec = await mount.position()
            with pytest.raises(SyncTooFar, match="Sync refused"):
                await mount.sync(ra + 90.0, dec)
            for wrong in (float("nan"), "5", None):
                with pytest.raises(Invalid, match=r"The right ascension must be a number of degrees, not "):
                    await mount.goto(wrong, 10.0)  # type: ignore[arg-type]
            with pytest.raises(Invalid, match=r"The declination must be a number of degrees from -90 to 90, not 91\."):
                await mount.sync(ra, 91.0)
            for site in (91.0, float("nan")):
                with pytest.raises(Invalid, match="TellSite: latitude: Expected"):
                    await mount.ask(requests.TellSite(site, 0.0))
            with pytest.raises(Invalid, match="Spot: ra: Expected a number, got nan"):
                await mount.ask(requests.Goto(requests.Spot(float("nan"), 0.0)))
            with pytest.raises(Invalid, match="Goto: where: Expected"):
                await mount.ask(requests.Goto("Vega"))  # type: ignore[arg-type]
            for nothing in ("Home", requests.Home):
                with pytest.raises(Invalid, match=r" is no request; write one like gateway\.core\.requests\.Home"):
                    await mount.ask(nothing)  # type: ignore[arg-type]
            with pytest.raises(Invalid, match="The name of an object must be a text, not 42"):
                await mount.goto_object(42)  # type: ignore[arg-type]
            with pytest.raises(UserError, match="did you mean Vega"):
                await mount.goto_object("Vegaa")
            await mount.ask(requests.Hold())
            with pytest.raises(Held, match="mount-gateway stop --release"):
                await mount.goto(ra, dec)
            await mount.ask(requests.Release())

    play(work())


def test_a_goto_that_is_stopped_says_so() -> None:
    async def work() -> None:
        async with running(speed=1) as mount:
            ra, dec = await mount.position()
            await mount.goto(ra + 60.0, dec)
            with pytest.raises(TimeoutError, match="goes on"):
                await mount.arrived(0.3)
            await connect().stop()
            with pytest.raises(Stopped, match="stopped on the way"):
                await mount.arrived()

    play(work())


def test_a_mount_that_is_lost_during_a_goto_is_not_waited_for_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arrival, "LOST", 1.0)

    async def work() -> None:
        async with open_gateway("nexstar@sim", **{**SIM, "speed": 1}) as gateway:
            await gateway.ready()
            mount = connect()
            ra, dec = await mount.position()
            await mount.goto(ra + 90.0, dec)
            Cable(gateway._gateway).pull()
            async with asyncio.timeout(PATIENCE):
                with pytest.raises(NoAnswer, match="not known whether the motion goes on: cannot open"):
                    await mount.arrived()

    play(work())


def test_a_stop_may_take_as_long_as_the_gateway_gives_it() -> None:
    assert ANSWERED >= LONGEST


def test_a_gateway_that_has_ended_does_not_answer() -> None:
    async def work() -> None:
        async with running() as mount:
            pass
        for asked in (mount.position(), mount.goto(1.0, 2.0), mount.stop()):
            with pytest.raises(NoAnswer):
                await asked
        with pytest.raises(UserError, match="no gateway runs here"):
            connect()

    play(work())


@pytest.mark.parametrize(("age", "told"), [(0.5, True), (OLD_AFTER + 1.0, False)])
def test_an_old_position_is_none(age: float, told: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    async def state(*_: object) -> State:
        return State(StatusLine("pier", "down", "no such port", Equatorial(10.0, 20.0), age), "nexstar@sim")

    monkeypatch.setattr(connected, "ask_state", state)
    mount = BlockingConnectedGateway(ConnectedGateway(ControlEndpoint("nexstar@sim", 1, 1, "s")))
    if told:
        assert mount.position() == (10.0, 20.0)
    else:
        with pytest.raises(NoAnswer, match="has not told where it points: no such port"):
            mount.position()


def test_of_several_one_must_be_named(tmp_path: Path) -> None:
    async def work() -> None:
        async with running(name="east", state=str(tmp_path)), open_gateway("lx200@sim", name="west", **SIM):
            with pytest.raises(UserError, match="2 mounts run here; say which one is meant: east, west"):
                connect()
            assert connect("west").name == "west"
            with pytest.raises(UserError, match="no gateway runs here for south"):
                connect("south")

    play(work())


def test_it_waits_for_programs_without_an_event_loop() -> None:
    with open_blocking_gateway("nexstar@sim", **SIM) as gateway:
        gateway.ready()
        mount = connect_blocking()
        ra, dec = mount.position()
        mount.goto(ra + 1.0, dec)
        assert near(mount.arrived(60.0), ra + 1.0, dec)
        assert mount.name == "nexstar@sim"
        mount.stop()


def test_both_faces_have_the_same_methods() -> None:
    for name, offered in vars(ConnectedGateway).items():
        if not name.startswith("_"):
            waits = vars(BlockingConnectedGateway)[name]
            assert waits.__doc__
            if inspect.isfunction(offered):
                assert not inspect.iscoroutinefunction(waits) and inspect.signature(waits) == inspect.signature(offered)
    assert inspect.signature(connect).parameters == inspect.signature(connect_blocking).parameters
