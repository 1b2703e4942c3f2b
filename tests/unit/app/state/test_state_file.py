"""The state file: always whole, whatever stands in its place is no obstacle, and a burst of changes is few writes."""

from __future__ import annotations

import asyncio
import errno
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.app.state import file as state
from gateway.app.state import store
from gateway.app.state.file import FORMAT_VERSION, SavedState, read_state, to_saved_state, to_settings
from gateway.diagnostics.virtual_time import run
from gateway.protocols.base.session import MountSettings, NamedSite
from gateway.system import files
from gateway.system.files import replace_file
from tests.support.forked import POSSIBLE
from tests.support.in_process_gateway import Bridge
from tests.support.process import Running

PRINTABLE = "".join(chr(code) for code in range(32, 127) if chr(code) != "#")
FULL = SavedState(
    FORMAT_VERSION,
    sites={"0": NamedSite("HOM", 45.5, -122.7), "3": NamedSite("Backyard (S) 7", None, 10.0)},
    site=3,
    zone=(-8.0, 1),
    pec=True,
    motors={"backlash 1 pos": 20, "guide rate 2": 128},
    mount={"home": {"az": 1.5, "alt": -3.25}, "parked": True},
)


@settings(max_examples=30)
@given(
    st.dictionaries(
        st.sampled_from("0123"),
        st.builds(
            NamedSite,
            st.none() | st.text(PRINTABLE, min_size=1, max_size=15),
            st.none() | st.floats(-90, 90),
            st.none() | st.floats(-360, 360),
        ).filter(lambda site: site != NamedSite()),
    ),
    st.none() | st.integers(0, 3),
    st.none() | st.booleans(),
    st.dictionaries(st.sampled_from(("backlash 1 pos", "backlash 2 neg", "guide rate 1")), st.integers(0, 255)),
)
def test_saved_state_is_restored(
    sites: dict[Any, NamedSite], site: int | None, pec: bool | None, motors: dict[str, int]
) -> None:
    kept = SavedState(FORMAT_VERSION, sites=sites, site=site, pec=pec, motors=motors)
    assert to_saved_state(to_settings(kept), {}) == kept
    assert state.msgspec.json.decode(state.encode_state(kept), type=SavedState) == kept


def test_state_file_is_replaced_with_owner_only_permissions(tmp_path: Path) -> None:
    path = tmp_path / "mount.json"
    for flush in (True, False):
        replace_file(path, state.encode_state(FULL), flush=flush)
        assert read_state(path) == FULL
    assert os.listdir(tmp_path) == ["mount.json"]
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("variables", "where"),
    [
        ({"STATE_DIRECTORY": "/var/lib/a:/var/lib/b", "XDG_STATE_HOME": "/x"}, "/var/lib/a"),
        ({"XDG_STATE_HOME": "/x"}, "/x/mount-gateway"),
        ({"HOME": "/home/somebody"}, "/home/somebody/.local/state/mount-gateway"),
        ({"HOME": "/home/somebody", "XDG_STATE_HOME": "not/absolute"}, "/home/somebody/.local/state/mount-gateway"),
    ],
)
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have other places")
def test_linux_state_folder_follows_systemd_and_xdg_variables(
    variables: dict[str, str], where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("STATE_DIRECTORY", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert files.state_folder() == Path(where)
    assert files.state_folder("/elsewhere") == Path("/elsewhere")


def test_state_file_of_every_mount_has_a_portable_name() -> None:
    names = [
        state.file_name("nexstar", where)
        for where in (
            "/dev/ttyUSB0",
            "COM3",
            "socket://10.0.0.5:4030",
            "hwgrep://0403:6001&skip_busy",
            "../../etc/x" * 30,
        )
    ]
    assert names[:3] == ["nexstar@dev_ttyUSB0", "nexstar@COM3", "nexstar@socket_10.0.0.5_4030"]
    assert all(len(name) <= 120 and not set(name) & set('/\\:*?"<>|&') for name in names)


# --- whatever stands in its place -------------------------------------------------------------------------------


def _begin(directory: Path) -> tuple[list[str], MountSettings]:
    """What a gateway that begins on this directory warns of, and what its clients begin with."""

    async def program() -> tuple[list[str], MountSettings]:
        async with Bridge(state=directory) as bridge:
            assert await bridge.client().ask(b":GM#") != b""
            assert bridge.store is not None
            return bridge.warned, bridge.store.shared.settings

    result: tuple[list[str], MountSettings] = run(program())
    return result


WHOLE = state.encode_state(FULL)
BAD = [
    b"",
    b"\0" * 200,
    b"\xff\xfe\x00",
    b"[]",
    b"null",
    b"{}",
    b"[" * 100_000,
    b"<html>",
    WHOLE + b"x",
    *(WHOLE[:length] for length in (1, 2, len(WHOLE) // 2, len(WHOLE) - 3)),
    WHOLE.replace(b'"format": 1', b'"format": 0'),
    WHOLE.replace(b'"format": 1', b'"format": 2'),
    WHOLE.replace(b"45.5", b"91"),
    WHOLE.replace(b'"HOM"', b'"A#B"'),
    WHOLE.replace(b'"HOM"', b'"' + b"x" * 16 + b'"'),
    WHOLE.replace(b": 128", b": 256"),
    WHOLE.replace(b'"site": 3', b'"site": 4'),
]


@pytest.mark.parametrize("content", BAD, ids=range(len(BAD)))
def test_unreadable_state_file_is_moved_aside(tmp_path: Path, content: bytes) -> None:
    assert content != WHOLE
    path = tmp_path / "nexstar@bridge.json"
    path.write_bytes(content)
    warned, shared = _begin(tmp_path)
    assert len(warned) == 1
    assert f"{path.name}.bad" in warned[0]
    assert shared == MountSettings()
    assert (tmp_path / f"{path.name}.bad").read_bytes() == content
    assert _begin(tmp_path)[0] == [], "said once"


def test_unknown_keys_in_a_state_file_are_ignored(tmp_path: Path) -> None:
    (tmp_path / "nexstar@bridge.json").write_bytes(WHOLE.replace(b"{", b'{"new": [1],', 1))
    warned, shared = _begin(tmp_path)
    assert (warned, shared.site, shared.zone) == ([], 3, (-8.0, 1))


@pytest.mark.parametrize("content", [b"", b"{", b'{"mount": 3}', b'{"mount": "", "baud": 1, "memory": {"version": 7}}'])
async def test_unreadable_motion_mark_still_stops_the_mount_at_start(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "nexstar@bridge.moving").write_bytes(content)
    async with Bridge(state=tmp_path) as bridge:
        assert bridge.sent_requests()[:4] == [b"Kx", b"P\2\x10$\0\0\0\0", b"P\2\x11$\0\0\0\0", b"M"]


@pytest.mark.parametrize("kind", ["a file in the way", "a directory in the way"])
async def test_unwritable_state_folder_is_reported_in_one_line(tmp_path: Path, kind: str) -> None:
    directory = tmp_path / "state"
    if kind == "a file in the way":
        directory.write_text("precious")
    else:
        (directory / "nexstar@bridge.json").mkdir(parents=True)
    async with Bridge(state=directory) as bridge:
        client = bridge.client()
        for name in (b"one", b"two", b"three"):
            assert await client.ask(b":SM%s#" % name) == b"1"
            assert await client.ask(b":GM#") == name + b"#"
            await asyncio.sleep(3)
        client.send(b":Mn#")
        await asyncio.sleep(1)
        assert bridge.controller.moving
        assert len(bridge.warned) == 1
        assert "state" in bridge.warned[0]
    if kind == "a file in the way":
        assert directory.read_text() == "precious"


async def test_state_is_saved_again_after_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    full = True

    def write(path: Path, data: bytes) -> None:
        if full:
            raise OSError(errno.ENOSPC, "No space left on device")
        replace_file(path, data)

    monkeypatch.setattr(store, "replace_file", write)
    async with Bridge(state=tmp_path) as bridge:
        client = bridge.client()
        for name in (b"one", b"two"):
            await client.ask(b":SM%s#" % name)
            await asyncio.sleep(3)
        assert len(bridge.warned) == 1
        assert "No space left" in bridge.warned[0]
        full = False
        await client.ask(b":SNthree#")
    sites = to_settings(read_state(tmp_path / "nexstar@bridge.json")).sites
    assert sites == {0: NamedSite("two"), 1: NamedSite("three")}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the proof forks")
def test_gateway_killed_while_saving_leaves_a_whole_state_file() -> None:
    """A taste of ``tests/soak/kill_saving.py``, which kills hundreds."""
    proof = str(Path(__file__).parents[3] / "soak" / "kill_saving.py")
    done = Running(proof, "--kills", "5", "--seed", "11", by=None if POSSIBLE else [sys.executable]).finish()
    assert done.returncode == 0, done.stdout + done.stderr


# --- when it is written -----------------------------------------------------------------------------------------


async def test_burst_of_changes_is_saved_in_few_writes_without_loss(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writes: list[bytes] = []
    monkeypatch.setattr(store, "replace_file", lambda path, data: (writes.append(data), replace_file(path, data)))
    async with Bridge(state=tmp_path) as bridge:
        client = bridge.client()
        for number in range(500):
            assert await client.ask(b":SM%d#" % number) == b"1"
            await asyncio.sleep(0.01)
        assert 2 <= len(writes) <= 7
        client.send(b":SN%d#" % 500)
        await asyncio.sleep(1.1)
        before = len(writes)
        client.send(b":SN%d#" % 500)  # nothing new
        await asyncio.sleep(3)
        assert len(writes) == before
        client.send(b":SOlast#")
    assert {index: site.name for index, site in read_state(tmp_path / "nexstar@bridge.json").sites.items()} == {
        "0": "499",
        "1": "500",
        "2": "last",
    }


async def test_slow_disk_delays_no_client(tmp_path: Path) -> None:
    async def slow(function: Any, *arguments: Any) -> Any:
        await asyncio.sleep(30)
        return function(*arguments)

    async with Bridge(state=tmp_path, in_thread=slow) as bridge:
        client, began = bridge.client(), bridge.controller.now()
        assert await client.ask(b":SMA#:GM#", ending=b"A#") == b"1A#"
        client.send(b":RM#:Mn#")
        while not bridge.controller.wanted.axes_moved_by_hand:
            await asyncio.sleep(0.001)
        assert bridge.controller.now() - began < 0.4, "two or three exchanges, and 20 ms for the mark"


# --- two gateways -----------------------------------------------------------------------------------------------


async def test_two_gateways_never_share_a_state_file(tmp_path: Path) -> None:
    async with Bridge(state=tmp_path) as first:
        await first.client().ask(b":SMfirst#")
        await asyncio.sleep(1)
        async with Bridge(state=tmp_path) as second:
            assert second.warned == []
            assert second.store and "another mount-gateway (process" in second.store.conflict_text
            client = second.client()
            assert await client.ask(b":GM#") == b"first#", "it begins with what there is"
            assert await client.ask(b":SMsecond#:GM#", ending=b"d#") == b"1second#"
            client.send(b":Mn#")
            await asyncio.sleep(2)
            assert not list(tmp_path.glob("*.moving"))
        assert first.warned == []
    async with Bridge(state=tmp_path) as third:
        assert await third.client().ask(b":GM#") == b"first#"
        assert third.warned == []
