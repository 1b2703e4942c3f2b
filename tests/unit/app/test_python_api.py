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
import time
from collections.abc import Coroutine
from pathlib import Path
from types import NoneType
from typing import Any, get_args

import pytest

import gateway
from gateway import (
    Entry,
    FrameError,
    NoAnswer,
    Splitter,
    UserError,
    connect,
    decode,
    decode_reply,
    encode,
    encode_reply,
    op,
    open_blocking_gateway,
    open_gateway,
)
from gateway.app.api import frames
from gateway.app.control.operations import answer_type
from gateway.app.control.orders import STOP_TIMEOUT
from gateway.app.control.reach import ANSWER_TIMEOUT
from tests.support.each import each
from tests.support.forked import POSSIBLE
from tests.support.process import Running

pytestmark = pytest.mark.real_time
ROOT = Path(gateway.__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SIM, SURFACE = "nexstar@sim", "lx200@tcp://127.0.0.1:0"
#: The Python programs of all pages.
PROGRAMS = [
    program
    for page in sorted((ROOT / "docs").rglob("*.md"))
    for program in re.findall(r"^```python\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
]


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))


def test_every_exported_name_can_be_imported_and_is_documented() -> None:
    page = (ROOT / "docs" / "python.md").read_text()
    for name in gateway.__all__:
        assert getattr(gateway, name).__doc__
        assert re.search(rf"`[^`\n]*\b{name}\b", page), f"docs/python.md does not mention {name}"
    with pytest.raises(AttributeError):
        _ = gateway.nothing_of_this_name


def test_python_page_opens_with_a_complete_short_script() -> None:
    page = (ROOT / "docs" / "python.md").read_text("utf-8")
    assert len(page.splitlines()) <= 120
    opening = page.partition("```python\n")[2].partition("```")[0]
    assert page.index(opening) < page.index("##") and 8 <= len(opening.splitlines()) <= 14


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_script_of_the_python_page_runs_as_pasted(program: str, tmp_path: Path) -> None:
    (script := tmp_path / "pasted.py").write_text(program)
    by = None if POSSIBLE else [sys.executable, "-W", "error"]
    alone = "connect_blocking()" not in program
    with contextlib.ExitStack() as stack:
        if not alone:
            stack.enter_context(open_blocking_gateway(SIM, name="pier")).ready()
        said = Running(str(script), by=by).finish()
    assert (said.returncode, said.stderr) == (0, "") and said.stdout
    assert alone or said.stdout.startswith("pier ")


def in_the_table(kind: type[op.Operation]) -> str:
    """Return the beginning of the row of an operation in docs/operations.md: fields with defaults, answer."""
    defaults = dict(zip(reversed(kind.__struct_fields__), reversed(kind.__struct_defaults__), strict=False))
    fields = [f"{name}={defaults[name]!r}" if name in defaults else name for name in kind.__struct_fields__]
    answer = answer_type(kind)
    names = [one.__name__ for one in get_args(answer) or [answer] if one is not NoneType]
    return f"| `{kind.__name__}({', '.join(fields)})` | {'`' * bool(names)}{', '.join(names)}{'`' * bool(names)} |"


def test_python_page_lists_every_operation_with_fields_and_answer() -> None:
    page = (ROOT / "docs" / "operations.md").read_text("utf-8")
    listed = re.findall(r"^\| `([A-Z]\w+)\(", page, re.MULTILINE)
    assert len(listed) == len(set(listed)) > 50
    kinds = {kind for name in dir(op) if (kind := op.operation_class(name)) is not None}
    assert set(listed) == {kind.__name__ for kind in kinds}
    for kind in kinds:
        assert f"\n{in_the_table(kind)} " in page


def test_importing_the_package_loads_no_submodule() -> None:
    code = "import sys, gateway; print([name for name in sys.modules if name.startswith('gateway.')])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=20)
    assert said.stdout.strip() == "[]"


def test_docstring_examples_give_the_shown_results() -> None:
    result = doctest.testmod(frames)
    assert result.attempted >= 6
    assert result.failed == 0


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_scripts_end_without_error_and_print_their_result(
    example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_command_values_survive_encoding_in_lx200_and_nexstar() -> None:
    assert encode("lx200", "Sd", dec=-5.5) == b":Sd-05*30:00#"
    assert decode("nexstar", encode("nexstar", "r", ra=83.5, dec=-5.5)).values == pytest.approx(
        {"ra": 83.5, "dec": -5.5}, abs=1e-4
    )
    told = encode_reply("nexstar", "e", ra=10.0, dec=-20.0)
    assert decode_reply("nexstar", "e", told).values == pytest.approx({"ra": 10.0, "dec": -20.0}, abs=1e-4)


@each(
    ("call", "words"),
    [
        (lambda: decode("meade", b":GR#"), "'meade' is not a protocol; there are lx200, nexstar"),
        (lambda: decode("lx200", b":xyz#"), "b':xyz#' is not a command of the lx200 protocol"),
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
        (lambda: decode_reply("lx200", "GR", b"what#"), "b'what#' is not a reply to GR"),
        (lambda: decode_reply("lx200", "Q", b"1"), "has no reply"),
        (lambda: encode_reply("lx200", "GR", dec=1.0), "no reply with dec; ra or ra"),
    ],
)
def test_encode_and_decode_errors_explain_the_wrong_value(call: object, words: str) -> None:
    assert callable(call)
    with pytest.raises(FrameError) as caught:
        call()
    assert words in str(caught.value)


def test_nexstar_bytes_are_split_into_whole_commands() -> None:
    clock = [0.0]
    splitter = Splitter("nexstar", lambda: clock[0])
    assert splitter.feed(b"e" + b"r12AB0500,") == [b"e"]
    assert splitter.feed(b"40000500") == [b"r12AB0500,40000500"]


# --- a gateway inside a program ---------------------------------------------------------------------------------------


async def test_python_program_finds_and_points_a_running_simulated_mount(tmp_path: Path) -> None:
    seen: list[Entry] = []
    settings = {"site": (48.1, 11.6), "lowest": -90, "sun": 0, "speed": 20, "name": "pier"}
    async with open_gateway(SIM, [{"at": SURFACE, "read_only": True}], watch=seen.append, **settings) as inside:
        with pytest.raises(UserError, match="no gateway runs here for south"):
            connect("south")
        for mount in (inside, connect(), connect("pier", state=str(tmp_path))):
            await mount.ready()
            assert mount.name == "pier"
            [address] = await mount.addresses()
            assert address.startswith("lx200:autostar@tcp://127.0.0.1:")
            ra, dec = await mount.position()
            await mount.goto(ra + 1.0, dec)
            assert await mount.arrived(30) == pytest.approx(((ra + 1.0) % 360.0, dec), abs=0.1)
            assert await mount.site() == op.Place(48.1, 11.6)
            assert (await mount.time()).unix == pytest.approx(time.time(), abs=60)
            await mount.move(op.Direction.NORTH, 5, 0.1)
            await mount.stop()
        async with open_gateway("lx200@sim", name="west"):
            with pytest.raises(UserError, match=r"2 mounts .*: pier, west"):
                connect()
    assert any(entry.side == "mount" and entry.data[:1] == b"r" for entry in seen)
    with pytest.raises(NoAnswer):
        await mount.position()
    with pytest.raises(UserError, match="no gateway runs here"):
        connect()


def test_answer_timeout_is_no_shorter_than_the_stop_timeout() -> None:
    assert ANSWER_TIMEOUT >= STOP_TIMEOUT


async def test_missing_port_is_reported_at_once() -> None:
    async with open_gateway("nexstar@/dev/ttyNONE", watchdog=False) as running, asyncio.timeout(10):
        with pytest.raises(UserError, match=r"^nexstar@/dev/ttyNONE: .*no such port"):
            await running.ready(60)


async def test_mount_in_use_is_reported_with_the_gateways_process() -> None:
    port = "nexstar@/dev/ttyNONE"
    async with open_gateway(port, watchdog=False), open_gateway(port, watchdog=False) as second:
        with pytest.raises(
            UserError, match=rf"^{port}: another gateway \(process {os.getpid()}\) already drives this mount"
        ):
            await second.ready(10)


async def test_python_gateway_opens_without_or_with_a_single_surface() -> None:
    async with open_gateway(SIM) as alone, open_gateway("lx200@sim", SURFACE) as serving:
        await alone.ready()
        assert await alone.addresses() == []
        assert len(await serving.addresses()) == 1


@pytest.mark.parametrize(
    ("surface", "settings", "words"),
    [
        (SURFACE, {"lowset": 3}, "open_gateway: [mount] lowset: there is no such key; did you mean 'lowest'?"),
        (
            SURFACE,
            {"record": "x.rec"},
            "open_gateway: record is not a setting of this function: mount-gateway run --record",
        ),
        (SURFACE, {"wait": True}, "open_gateway: wait is not a setting of this function: ready(seconds) waits"),
        (SURFACE, {"lowest": 100}, "open_gateway: [mount] lowest: 100: write "),
        ("lx200", {}, "write PROTOCOL[:MODEL[/VERSION]]@WHERE"),
        ("lx200@tcp://256.0.0.1:4030", {}, "256.0.0.1"),
    ],
)
def test_unusable_setting_raises_a_user_error(surface: str, settings: dict[str, object], words: str) -> None:
    async def opens() -> None:
        async with open_gateway(SIM, [surface], **settings):
            raise AssertionError("it was opened")

    with pytest.raises(UserError) as caught:
        asyncio.run(opens())
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("example", "arguments"),
    [("tiny_client", ["127.0.0.1:4030"]), ("tiny_client", ["127.0.0.1", "lx200"]), ("like_skysafari", ["a", "4030"])],
)
def test_example_script_shows_its_usage_for_wrong_arguments(
    example: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [example, *arguments])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(ROOT / "examples" / f"{example}.py"), run_name="__main__")
    assert (end.value.code, capsys.readouterr().err[:7]) == (2, "usage: ")


@pytest.mark.parametrize(
    "path", [path for path in EXAMPLES if "asyncio.run" in path.read_text("utf-8")], ids=lambda path: path.stem
)
def test_interrupted_example_script_ends_with_a_sentence(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(program: Coroutine[Any, Any, None]) -> None:
        program.close()
        raise KeyboardInterrupt

    monkeypatch.setattr(asyncio, "run", interrupted)
    monkeypatch.setattr(sys, "argv", [path.name])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(path), run_name="__main__")
    assert end.value.code and "Traceback" not in str(end.value.code)
