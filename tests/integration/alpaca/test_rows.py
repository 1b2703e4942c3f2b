"""Gateways in a row, as processes: an LX200 program, two gateways between it and a third one, judged by ``--truth``."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path
from typing import Any

import pytest

from gateway.astro.axes import Observer
from gateway.astro.spherical import horizon_to_hour_angle, separation, wrap360
from tests.support.process import Running, ask, run_to_end
from tests.support.sampling import WHOLE
from tests.support.typed_programs import dms, hms, parse_dec, parse_ra

SITE = Observer(45.0, 10.0)
#: Half a second of right ascension, and half an arcsecond.
EXACT = 10.0


def run(state: Path, name: str, mount: str, surface: str) -> Running:
    flags = ("--sun", "0", "--no-discovery", "--no-console", "--state", str(state / name))
    return Running("run", "--mount", mount, "--surface", f"{surface}@tcp://127.0.0.1:0", *flags)


@pytest.mark.skipif(not WHOLE, reason="it takes four processes a minute; pytest --whole runs it")
@pytest.mark.parametrize("mount", ["nexstar:cge", "nexstar:cpc", "lx200:lx200gps"])
def test_chain_of_three_gateways_carries_goto_sync_arrow_and_stop(
    tmp_path: Path, started: list[Running], mount: str
) -> None:
    """Goto, sync, arrow and stop at one end are what the axes do at the other, and what is told is where it points."""
    truth = tmp_path / "truth.jsonl"

    def begin(one: Running) -> str:
        started.append(one)
        return one.ready()

    def row() -> dict[str, Any]:
        found: dict[str, Any] = json.loads(truth.read_text().rstrip("\n").rpartition("\n")[2])
        return found

    def sky() -> tuple[float, float]:
        now = row()
        dec = horizon_to_hour_angle(now["azimuth"], now["altitude"], SITE.latitude)[1]
        return wrap360(SITE.lst(now["t"]) - now["hour_angle"]), dec

    def rests() -> None:
        time.sleep(3.0)
        end = time.monotonic() + 60.0
        while row()["moving"] and time.monotonic() < end:
            time.sleep(0.3)

    where = begin(Running("sim", mount, "--at", "tcp://127.0.0.1:0", "--truth", str(truth), "--speed", "4"))
    first = begin(run(tmp_path, "1", f"{mount.partition(':')[0]}@{where.replace('tcp:', 'socket:')}", "alpaca"))
    second = begin(run(tmp_path, "2", f"alpaca@{first.replace('tcp:', 'http:')}", "alpaca"))
    last = begin(run(tmp_path, "3", f"alpaca@{second.replace('tcp:', 'http:')}/0", "lx200:lx200gps"))

    def told() -> tuple[float, float]:
        return parse_ra(ask(last, b":GR#")), parse_dec(ask(last, b":GD#"))

    def off(one: tuple[float, float], other: tuple[float, float]) -> float:
        return separation(*one, *other) * 3600.0

    goal = round(wrap360(SITE.lst(row()["t"]) + 20.0) * 240.0) / 240.0, 33.2575
    assert ask(last, f":Sr{hms(goal[0])}#:Sd{dms(goal[1])}#:MS#".encode(), b"110") == b"110"
    rests()
    time.sleep(3.0)
    assert off(sky(), goal) < EXACT and off(told(), goal) < 2.0 * EXACT
    stood = sky()
    ask(last, b":RM#:Mn#:GR#")
    time.sleep(1.5)
    ask(last, b":Qn#:GR#")
    rests()
    assert 0.3 < sky()[1] - stood[1] < 10.0
    assert ask(last, f":Sr{hms(goal[0] - 40.0)}#:Sd{dms(10.0)}#:MS#".encode(), b"110") == b"110"
    time.sleep(1.5)
    assert row()["moving"]
    ask(last, b":Q#:GR#")
    time.sleep(4.0)
    assert not row()["moving"] and row()["tracking"]
    here = sky()
    centred = round((here[0] + 0.5) * 240.0) / 240.0, round((here[1] + 0.5) * 3600.0) / 3600.0
    ask(last, f":Sr{hms(centred[0])}#:Sd{dms(centred[1])}#:CM#".encode())
    time.sleep(4.0)
    assert off(told(), centred) < 2.0 * EXACT and off(sky(), here) < 2.0 * EXACT


def test_gateway_configured_to_drive_itself_reports_it_and_exits(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    flags = ("--no-discovery", "--no-console", "--state", str(tmp_path))
    mount, surface = f"alpaca@http://127.0.0.1:{port}", f"alpaca@tcp://127.0.0.1:{port}"
    done = run_to_end("run", "--mount", mount, "--surface", surface, *flags)
    assert done.returncode == 2
    assert "the mount there is this very gateway" in done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
