"""A real process that speaks Alpaca: at its own port, the console's, and one for every protocol; and recorded."""

from __future__ import annotations

import http.client
import json
import signal
import sys
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest

from tests.support.process import PATIENCE, Running, run_to_end

API = "/api/v1/telescope/0/"


def ask(where: str, method: str, member: str, called: str = "", **parameters: str) -> Any:
    """The value; an error as its number below 0, and what is not understood as its HTTP status."""
    host, _, port = where.split("://")[1].rstrip("/").rpartition(":")
    link = http.client.HTTPConnection(host, int(port), timeout=PATIENCE)
    form = {"Content-Type": "application/x-www-form-urlencoded"} if method == "PUT" else {}
    form |= {"Host": called} if called else {}
    try:
        link.request(method, API + member, urlencode(parameters) if method == "PUT" else None, form)
        response = link.getresponse()
        told = response.read()
        if response.status == 503:  # it loads its web server
            return ask(where, method, member, called, **parameters)
        if response.status != 200:
            return response.status
        answer = json.loads(told)
        return -answer["ErrorNumber"] if answer["ErrorNumber"] else answer.get("Value")
    finally:
        link.close()


def used(where: str) -> None:
    """A program connects, looks, and goes somewhere."""
    assert ask(where, "PUT", "connected", Connected="True") is None
    assert isinstance(ask(where, "GET", "rightascension"), float)
    assert ask(where, "PUT", "slewtocoordinatesasync", RightAscension="5.5", Declination="88") is None
    assert ask(where, "GET", "slewing") is True
    assert ask(where, "PUT", "abortslew") is None
    assert ask(where, "GET", "nothing") == 400


def start(state: Path, *more: str) -> Running:
    return Running("run", "--mount", "nexstar@sim", "--sun", "0", "--no-discovery", "--state", str(state), *more)


@pytest.mark.parametrize("loop", ["uvloop", "asyncio"])
def test_alpaca_is_served_at_a_port_of_its_own(tmp_path: Path, loop: str) -> None:
    own = start(
        tmp_path, "--surface", "alpaca@tcp://127.0.0.1:0", *(["--loop", "asyncio"] if loop == "asyncio" else [])
    )
    used(own.ready())
    assert own.end() == 0


@pytest.mark.parametrize(
    ("console", "surface", "page"),
    [("", "", "act"), ("", "read-only = true", "look"), ('[console]\nallow = ["127.0.0.2"]', "", "allow list")],
)
def test_console_at_an_alpaca_port_obeys_read_only_and_the_allow_list(
    tmp_path: Path, console: str, surface: str, page: str
) -> None:
    config = tmp_path / "gateway.toml"
    config.write_text(f'{console}\n[[surface]]\nat = "alpaca@tcp://127.0.0.1:0"\n{surface}\n')
    own = start(tmp_path, str(config), "--console", "tcp://127.0.0.1:0")
    link = http.client.HTTPConnection("127.0.0.1", int(own.ready().rpartition(":")[2]), timeout=PATIENCE)
    link.request("GET", "/")
    assert page in link.getresponse().read().decode()
    link.close()
    assert own.end() == 0


def test_alpaca_is_served_at_the_console_port_and_at_the_any_protocol_port(tmp_path: Path) -> None:
    """Both are the same server; the recording holds its programs as it holds all others."""
    path = tmp_path / "a.rec"
    own = start(tmp_path, "--surface", "any@tcp://127.0.0.1:0", "--console", "tcp://127.0.0.1:0", "--record", str(path))
    every = own.ready()
    assert own.process.stdout is not None
    page = next(line.split()[-1] for line in own.process.stdout if line.startswith("ready console"))
    used(page)
    used(every)
    assert own.end() == 0
    said = run_to_end("decode", str(path)).stdout
    assert "go to a position: RA 05:30:00" in said and "rightascension: RA" in said


@pytest.mark.parametrize("console", [["--console", "tcp://127.0.0.1:0"], []])
def test_alpaca_surface_answers_only_to_configured_host_names(tmp_path: Path, console: list[str]) -> None:
    """A container's published port, or a router: the program types the name or the address of that."""
    config = tmp_path / "gateway.toml"
    config.write_text(
        '[[surface]]\nat = "any@tcp://127.0.0.1:0"\nnames = ["pier.example.org"]\n'
        '[[surface]]\nat = "alpaca@tcp://127.0.0.1:0"\nnames = ["203.0.113.7"]\n', "utf-8"
    )  # fmt: skip
    own = start(tmp_path, str(config), *console)
    every, alone = own.ready(), own.ready()
    assert ask(every, "GET", "interfaceversion", "pier.example.org:8080") == 4
    assert ask(alone, "GET", "interfaceversion", "203.0.113.7:32768") == 4
    assert [ask(where, "GET", "interfaceversion", "rebound.example.com") for where in (every, alone)] == [403] * 2
    assert own.end() == 0


def test_web_server_is_loaded_only_at_the_first_request(tmp_path: Path) -> None:
    """Not before: no start waits for it. The process says whether it is, when it is sent SIGUSR1 and at its end."""
    said = "say = lambda *_: print('aiohttp' in sys.modules, file=sys.stderr)"
    told = "atexit.register(say); signal.signal(signal.SIGUSR1, say)"
    look = (
        f"import atexit, signal, sys, runpy; sys.argv[0] = 'mount-gateway'\n{said}\n{told}\nrunpy.run_module('gateway')"
    )
    own = Running(
        "run", "--mount", "nexstar@sim", "--no-discovery", "--state", str(tmp_path),
        "--surface", "alpaca@tcp://127.0.0.1:0", by=[sys.executable, "-c", look],
    )  # fmt: skip
    where = own.ready()
    own.process.send_signal(signal.SIGUSR1)
    assert ask(where, "GET", "interfaceversion") == 4
    assert own.end(signal.SIGTERM) == 0
    assert own.said.splitlines()[-2:] == ["False", "True"]


@pytest.mark.parametrize("where", ["pty:/tmp/mount", "rfc2217://127.0.0.1:4030", "web"])
def test_alpaca_surface_is_refused_at_anything_but_a_tcp_port(where: str) -> None:
    done = run_to_end("config", "--mount", "nexstar@sim", "--surface", f"alpaca@{where}")
    assert done.returncode == 2
    assert "write alpaca@tcp://127.0.0.1:11111" in done.stderr
