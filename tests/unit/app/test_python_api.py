"""What ``gateway`` offers to other programs: frames, a gateway inside a program, and the examples that show them."""

from __future__ import annotations

import asyncio
import contextlib
import doctest
import os
import re
import runpy
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import NoneType
from typing import Any, get_args

import numpy
import pytest

import gateway
from gateway import (
    BelowHorizon,
    Entry,
    Fault,
    FrameError,
    Invalid,
    NoAnswer,
    RunningGateway,
    Splitter,
    Stopped,
    UserError,
    decode,
    decode_reply,
    encode,
    encode_reply,
    open_gateway,
)
from gateway.app.api import arrival, frames
from gateway.app.control import objects
from gateway.core import operations as op
from gateway.protocols.wireformat.command_set import load
from tests.support.cable import Cable
from tests.support.each import each
from tests.support.forked import POSSIBLE
from tests.support.process import PATIENCE, Running

ROOT = Path(gateway.__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SIM, SURFACE = "nexstar@sim", "lx200@tcp://127.0.0.1:0"


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))


def test_every_name_that_is_offered_can_be_imported_and_is_documented() -> None:
    page = (ROOT / "docs" / "python.md").read_text()
    for name in gateway.__all__:
        assert getattr(gateway, name).__doc__
        assert f"`{name}" in page, f"docs/python.md does not mention {name}"
    with pytest.raises(AttributeError):
        _ = gateway.nothing_of_this_name


def in_the_table(kind: type[op.Operation]) -> str:
    """Return the beginning of the row of an operation in docs/python.md: its fields with their defaults, its answer."""
    defaults = dict(zip(reversed(kind.__struct_fields__), reversed(kind.__struct_defaults__), strict=False))
    fields = [f"{name}={defaults[name]!r}" if name in defaults else name for name in kind.__struct_fields__]
    (answer,) = get_args(kind.__orig_bases__[0])  # type: ignore[attr-defined]
    names = [one.__name__ for one in get_args(answer) or [answer] if one is not NoneType]
    return f"| `{kind.__name__}({', '.join(fields)})` | {'`' * bool(names)}{', '.join(names)}{'`' * bool(names)} |"


def test_the_page_lists_every_operation_with_its_fields_and_its_answer() -> None:
    page = (ROOT / "docs" / "python.md").read_text("utf-8").partition("## Operations")[2]
    listed = re.findall(r"^\| `([A-Z]\w+)\(", page, re.MULTILINE)
    assert len(listed) == len(set(listed)) > 50
    kinds = {kind for name in dir(op) if (kind := op.named(name)) is not None}
    assert set(listed) == {kind.__name__ for kind in kinds}
    for kind in kinds:
        assert f"\n{in_the_table(kind)} " in page


def test_importing_the_package_loads_next_to_nothing() -> None:
    code = "import sys, gateway; print([name for name in sys.modules if name.startswith('gateway.')])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=20)
    assert said.stdout.strip() == "[]"


def test_the_examples_of_the_docstrings_are_true() -> None:
    result = doctest.testmod(frames)
    assert result.attempted >= 6
    assert result.failed == 0


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    said = Running(str(example), by=None if POSSIBLE else [sys.executable, "-W", "error"]).finish()
    assert (said.returncode, said.stderr) == (0, "")
    told = {
        "read_a_conversation": "BelowHorizon",
        "embed_a_gateway": "arrived at right ascension",
        "point_from_a_script": "Polaris: arrived",
        "ask_a_running_gateway": "Polaris: arrived",
        "tiny_client": "(",
        "like_skysafari": "at rest: 09:57:5",
    }
    assert told[example.stem] in said.stdout


# --- frames -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("protocol", ["lx200", "nexstar"])
def test_every_command_without_values_is_decoded_as_it_was_encoded(protocol: str) -> None:
    tried = 0
    for name, command in load(protocol).commands.items():
        if not command.request.fields:
            assert decode(protocol, encode(protocol, name)).name == name
            tried += 1
    assert tried > 20


def test_values_pass_through_a_frame_of_either_protocol() -> None:
    assert encode("lx200", "Sd", dec=-5.5) == b":Sd-05*30:00#"
    assert decode("nexstar", encode("nexstar", "r", ra=83.5, dec=-5.5)).values == pytest.approx(
        {"ra": 83.5, "dec": -5.5}, abs=1e-4
    )
    told = encode_reply("nexstar", "e", ra=10.0, dec=-20.0)
    assert decode_reply("nexstar", "e", told).values == pytest.approx({"ra": 10.0, "dec": -20.0}, abs=1e-4)


@each(
    ("call", "words"),
    [
        (lambda: decode("meade", b":GR#"), "'meade' is no protocol; there are lx200, nexstar"),
        (lambda: decode("lx200", b":xyz#"), "b':xyz#' is no command of the lx200 protocol"),
        (
            lambda: decode("lx200", b":Sr25:00:00#"),
            "Sr (set the target right ascension): '25:00:00' is not from 0 to 360",
        ),
        (lambda: encode("lx200", "nonsense"), "no command called 'nonsense'"),
        (lambda: encode("lx200", "Sr"), "Sr (set the target right ascension) needs ra"),
        (lambda: encode("lx200", "Sr", ra="east"), "Sr (set the target right ascension): "),
        (lambda: encode("lx200", "Sr", ra=float("nan")), "(set the target right ascension): ra cannot be nan"),
        (lambda: encode("lx200", "Sd", dec=95), "dec cannot be 95: an altitude, declination or latitude lies beyond"),
        (lambda: encode("lx200", "Sr", dec=3.0), "Sr (set the target right ascension) has no dec; it has ra"),
        (lambda: encode("lx200", "GR", ra=3.0), "has no ra; it has no values"),
        (lambda: decode_reply("lx200", "GR", b"what#"), "b'what#' is no reply to GR"),
        (lambda: decode_reply("lx200", "Q", b"1"), "has no reply"),
        (lambda: encode_reply("lx200", "GR", dec=1.0), "no reply with dec; ra or ra"),
    ],
)
def test_what_does_not_fit_is_told_in_words(call: object, words: str) -> None:
    assert callable(call)
    with pytest.raises(FrameError) as caught:
        call()
    assert words in str(caught.value)


def test_a_stream_is_cut_into_commands() -> None:
    clock = [0.0]
    splitter = Splitter("nexstar", lambda: clock[0])
    assert splitter.feed(b"e" + b"r12AB0500,") == [b"e"]
    assert splitter.feed(b"40000500") == [b"r12AB0500,40000500"]


# --- a gateway inside a program ---------------------------------------------------------------------------------------


def test_a_program_points_a_simulated_mount() -> None:
    async def points() -> None:
        seen: list[Entry] = []
        settings = {"site": (48.1, 11.6), "lowest": -90, "sun": 0, "speed": 20}
        async with open_gateway(SIM, [{"at": SURFACE, "read_only": True}], watch=seen.append, **settings) as running:
            await running.ready()
            assert running.addresses[0].startswith("lx200:autostar@tcp://127.0.0.1:")
            await running.goto(380.0, 80.0)  # above the horizon at any hour
            assert await running.arrived(30) == pytest.approx((20.0, 80.0), abs=0.1)
            await running.sync(21.0, 80.0)
            assert await running.position() == pytest.approx((21.0, 80.0), abs=0.1)
            assert isinstance(await running.perform(op.GetStatus()), op.Status)
            assert await running.site() == op.Place(48.1, 11.6)
            assert (await running.time()).unix == pytest.approx(time.time(), abs=60)
        assert any(entry.side == "mount" and entry.data[:1] == b"r" for entry in seen)

    asyncio.run(points())


def test_a_stop_ends_a_goto_and_is_told_to_who_waits_for_it() -> None:
    async def stops() -> None:
        async with open_gateway(SIM, [SURFACE], site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            await running.goto(20.0, 80.0)
            waiting = asyncio.ensure_future(running.arrived(30))
            await asyncio.sleep(0)
            await running.stop()
            with pytest.raises(Stopped):
                await waiting
            assert await running.perform(op.Slewing()) is False

    asyncio.run(stops())


async def ask(running: RunningGateway, frames: bytes) -> None:
    """Send frames as another program, and wait until they are carried out."""
    host, _, port = running.addresses[0].rpartition("//")[2].rpartition(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(frames + b":D#")
    await reader.readuntil(b"#")
    writer.close()


#: How the goto of a program ends before its goal -> what ``arrived`` says, although it is asked only after that.
ENDINGS: dict[str, Callable[[RunningGateway], Coroutine[Any, Any, None]]] = {
    "Stopped by the program that embeds the gateway, at ": lambda running: running.stop(),
    "Stopped by the program that embeds the gateway, at +": lambda running: running.perform(op.AbortSlew()),
    "Stopped by the program that embeds the gateway, at -": lambda running: running.perform(op.AbortMotion()),
    "Stopped by 127.0.0.1, at ": lambda running: ask(running, b":Q#"),
    "Another goto came from 127.0.0.1, at ": lambda running: ask(running, b":Sr02:00:00#:Sd+70*00:00#:MS#"),
}


@pytest.mark.parametrize("words", ENDINGS)
def test_a_goto_that_ended_before_it_was_waited_for_is_told_all_the_same(words: str) -> None:
    async def program() -> None:
        async with open_gateway(SIM, [SURFACE], site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            await running.goto(20.0, 80.0)
            await ENDINGS[words](running)
            for _ in range(2):
                with pytest.raises(Stopped, match=words.rstrip("+-")):
                    await running.arrived(10)
            assert running.ended_short in words
            assert running.ended_short

    asyncio.run(program())


def test_a_stop_after_the_arrival_is_no_end_of_the_goto() -> None:
    async def program() -> None:
        async with open_gateway(SIM, [SURFACE], site=(48.1, 11.6), lowest=-90, sun=0, speed=200) as running:
            await running.ready()
            await running.goto(20.0, 80.0)  # above the horizon at any hour
            await running.arrived(30)
            await running.stop()
            assert await running.arrived(10) == pytest.approx((20.0, 80.0), abs=0.1)

    asyncio.run(program())


def test_a_goto_that_takes_too_long_is_told_in_words() -> None:
    async def program() -> None:
        async with open_gateway(SIM, site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            await running.goto(20.0, 80.0)
            with pytest.raises(TimeoutError, match=r"The motion has not ended within 0\.05 s; it goes on\."):
                await running.arrived(0.05)

    asyncio.run(program())


def test_an_object_is_found_by_its_name_and_the_mount_is_parked_by_a_method() -> None:
    async def program() -> None:
        seen: list[bytes] = []

        def watch(entry: Entry) -> None:
            if entry.arrow == ">" and entry.data[:1] in b"TRrBb":
                seen.append(entry.data)

        async with open_gateway(SIM, site=(48.1, 11.6), lowest=-90, sun=0, speed=200, watch=watch) as running:
            await running.ready()
            await running.goto_object("Polaris")
            ra, dec = await running.arrived(30)
            polaris = await running.perform(op.ToEquinoxOfDate(37.95, 89.26))
            assert (ra, dec) == pytest.approx((polaris.ra, polaris.dec), abs=0.5)
            with pytest.raises(UserError, match="did you mean Vega"):
                await running.goto_object("Vegaa")
            with pytest.raises(Invalid, match=r"The name of an object must be a text, not 42\."):
                await running.goto_object(42)  # type: ignore[arg-type]
            await running.park()
            await running.arrived(30)
            activity = await running.perform(op.GetActivity())
            assert activity.parked and not activity.goto
            assert seen[-1] == b"T\x00"  # the last order of all: tracking is turned off

    asyncio.run(program())


def test_a_stop_while_a_name_is_looked_up_leaves_the_goto_unbegun(monkeypatch: pytest.MonkeyPatch) -> None:
    async def program() -> None:
        async with open_gateway(SIM, site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            find, go_on = objects.find, threading.Event()
            monkeypatch.setattr(objects, "find", lambda name: (go_on.wait(30), find(name))[1])
            going = asyncio.ensure_future(running.goto_object("Polaris"))
            await asyncio.sleep(0.1)
            await running.stop()
            go_on.set()
            with pytest.raises(Stopped):
                await going
            assert not await running.moving()

    asyncio.run(program())


def test_a_stop_of_a_goto_of_another_program_is_told_to_who_waits_for_its_end() -> None:
    async def program() -> None:
        async with open_gateway(SIM, [SURFACE], site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            ra, dec = await running.position()
            await running.goto(ra + 1.0, dec)
            await running.arrived(30)
            await ask(running, b":Sr02:00:00#:Sd-70*00:00#:MS#")
            waiting = asyncio.ensure_future(running.arrived(30))
            await asyncio.sleep(0.1)
            assert not waiting.done()
            await ask(running, b":Q#")
            with pytest.raises(Stopped):
                await waiting
            assert await running.arrived(30)

    asyncio.run(program())


def test_a_mount_that_is_lost_during_a_goto_is_not_waited_for_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arrival, "LOST", 1.0)

    async def program() -> None:
        async with open_gateway(SIM, site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            await running.goto(20.0, 80.0)
            Cable(running._gateway).pull()
            with pytest.raises(TimeoutError, match=r"within 0\.5 s, and it is not known whether it goes on: "):
                await running.arrived(0.5)
            async with asyncio.timeout(PATIENCE):
                with pytest.raises(NoAnswer, match=r"not known whether the motion goes on: cannot open .*no such port"):
                    await running.arrived()

    asyncio.run(program())


def test_limits_hold_for_the_program_too() -> None:
    async def refuses() -> None:
        async with open_gateway(SIM, [SURFACE], site=(48.1, 11.6)) as running:
            await running.ready()
            with pytest.raises(
                Fault, match=r"Below Horizon\. That is lower than the 0 degrees .* open it with another lowest"
            ):
                await running.goto(0.0, -80.0)

    asyncio.run(refuses())


def test_a_mount_that_does_not_answer_is_told_in_words() -> None:
    async def waits() -> None:
        async with open_gateway(SIM, [SURFACE], latency=3.0) as running:
            with pytest.raises(
                NoAnswer, match=r"nexstar@sim has not answered within 0\.05 s\. Is it switched on, .* detect"
            ):
                await running.ready(0.05)

    asyncio.run(waits())


def test_a_port_that_does_not_exist_is_told_at_once() -> None:
    async def waits() -> None:
        async with open_gateway("nexstar@/dev/ttyNONE", watchdog=False) as running, asyncio.timeout(10):
            with pytest.raises(UserError, match=r"^nexstar@/dev/ttyNONE: cannot open /dev/ttyNONE: no such port"):
                await running.ready(60)

    asyncio.run(waits())


def test_a_mount_that_another_gateway_has_is_told_with_its_process() -> None:
    async def waits() -> None:
        port = "nexstar@/dev/ttyNONE"
        async with open_gateway(port, watchdog=False), open_gateway(port, watchdog=False) as second:
            with pytest.raises(UserError, match=rf"^{port}: another gateway \(process {os.getpid()}\) has this mount"):
                await second.ready(10)

    asyncio.run(waits())


def test_a_program_needs_no_surface_and_may_write_one_without_a_list() -> None:
    async def opens() -> None:
        async with open_gateway(SIM) as alone, open_gateway("lx200@sim", SURFACE) as serving:
            await alone.ready()
            assert alone.addresses == []
            assert len(serving.addresses) == 1

    asyncio.run(opens())


@pytest.mark.parametrize(
    ("surface", "settings", "words"),
    [
        (SURFACE, {"lowset": 3}, "open_gateway: [mount] lowset: there is no such key; did you mean 'lowest'?"),
        (
            SURFACE,
            {"record": "x.rec"},
            "open_gateway: record is no setting of this function: mount-gateway run --record",
        ),
        (SURFACE, {"wait": True}, "open_gateway: wait is no setting of this function: ready(seconds) waits"),
        (SURFACE, {"lowest": 100}, "open_gateway: [mount] lowest: 100: write "),
        ("lx200", {}, "write PROTOCOL[:MODEL[/VERSION]]@WHERE"),
        ("lx200@tcp://256.0.0.1:4030", {}, "256.0.0.1"),
    ],
)
def test_a_setting_that_cannot_be_used_is_a_user_error(surface: str, settings: dict[str, object], words: str) -> None:
    async def opens() -> None:
        async with open_gateway(SIM, [surface], **settings):
            raise AssertionError("it was opened")

    with pytest.raises(UserError) as caught:
        asyncio.run(opens())
    assert words in str(caught.value)


@each("ra, dec", [(float("nan"), 80.0), (40.0, float("inf")), (400.0, 95.0), ("05:34:32", 22.0), (None, 22.0)])
def test_what_is_no_place_is_refused_at_once_and_the_gateway_goes_on(ra: Any, dec: Any) -> None:
    async def program() -> None:
        async with open_gateway("nexstar@sim", ["lx200@tcp://127.0.0.1:0"]) as running:
            await running.ready()
            for order in (running.goto, running.sync):
                with pytest.raises(Fault, match="must be a number"):
                    await order(ra, dec)
            assert await running.position()

    asyncio.run(program())


@each(
    ("operation", "words"),
    [
        ("goto", "'goto' is no operation"),
        (op.Position, "is no operation"),
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
def test_what_is_no_operation_is_refused_in_a_sentence(operation: Any, words: str) -> None:
    async def program() -> None:
        async with open_gateway(SIM, site=(48.1, 11.6)) as running:
            await running.ready()
            with pytest.raises(Fault) as caught:
                await running.perform(operation)
            assert words in str(caught.value)

    asyncio.run(program())


def test_a_position_of_a_catalogue_is_taken_as_one_of_j2000() -> None:
    async def program() -> None:
        async with open_gateway(SIM, site=(48.1, 11.6), lowest=-90, sun=0, speed=200) as running:
            assert await running.perform(op.Zenith())  # it waits for the site
            there = await running.perform(op.ToEquinoxOfDate(20.0, 60.0))  # above the horizon at any hour
            assert abs(there.ra - 20.0) > 0.2
            await running.goto(20.0, 60.0, j2000=True)
            assert await running.arrived(30) == pytest.approx((there.ra, there.dec), abs=0.05)
            await running.sync(21.0, 60.5, j2000=True)
            assert await running.position() == pytest.approx((there.ra + 1.0, there.dec + 0.5), abs=0.05)

    asyncio.run(program())


def test_what_needs_the_site_waits_for_the_one_of_the_mount() -> None:
    async def program() -> None:
        async with open_gateway(SIM) as running:
            await running.ready()
            assert await running.perform(op.Zenith())
            with contextlib.suppress(BelowHorizon):
                assert await running.perform(op.MoonPlace())

    asyncio.run(program())


@pytest.mark.parametrize(
    ("example", "arguments"),
    [("tiny_client", ["127.0.0.1:4030"]), ("tiny_client", ["127.0.0.1", "lx200"]), ("like_skysafari", ["a", "4030"])],
)
def test_an_example_with_wrong_arguments_says_how_it_is_used(
    example: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [example, *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(ROOT / "examples" / f"{example}.py"), run_name="__main__")
    assert (end.value.code, capsys.readouterr().err[:7]) == (2, "usage: ")


def test_numbers_of_other_libraries_are_numbers() -> None:
    async def program() -> None:
        async with open_gateway(SIM, site=(48.1, 11.6), lowest=-90, sun=0) as running:
            await running.ready()
            await running.goto(numpy.float32(20.0), numpy.int64(10))  # type: ignore[arg-type]
            await running.perform(op.Move("n", op.Rate(key=numpy.int8(2))))  # type: ignore[arg-type]
            await running.stop()

    asyncio.run(program())


@pytest.mark.parametrize(
    "path", [path for path in EXAMPLES if "asyncio.run" in path.read_text("utf-8")], ids=lambda path: path.stem
)
def test_an_example_that_is_interrupted_ends_in_a_sentence(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(program: Coroutine[Any, Any, None]) -> None:
        program.close()
        raise KeyboardInterrupt

    monkeypatch.setattr(asyncio, "run", interrupted)
    monkeypatch.setattr(sys, "argv", [path.name])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(path), run_name="__main__")
    assert end.value.code and "Traceback" not in str(end.value.code)
