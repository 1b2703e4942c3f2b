"""What a gateway weighs: which packages it imports and when, and what a computer with little room needs."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
import tomllib
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest

from tests.support.process import EAGER, PATIENCE, Running, ask

ROOT = Path(__file__).resolve().parents[2]
#: Only the process that calculates the almanac imports these; PyYAML is astropy's own need.
FOR_ASTROPY = {"astropy", "astropy-iers-data", "numpy", "pyerfa"}


def _plain(requirement: str) -> str:
    match = re.match(r"[\w.-]+", requirement)
    assert match
    return match[0].lower().replace("_", "-")


def test_requirements_file_for_small_computers_lists_everything_but_astropy() -> None:
    """``--no-deps`` installs what is named and nothing else, so what the packages need is named too."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    named = {line for line in (ROOT / "docs/without-astropy.txt").read_text("utf-8").splitlines() if line[:1] != "#"}
    own = {line for line in project["dependencies"] if _plain(line) not in FOR_ASTROPY}
    assert own <= named
    needed, left = set(map(_plain, own)), list(map(_plain, own))
    while left:
        for line in requires(left.pop()) or []:
            name, _, marker = line.partition(";")
            if "extra ==" in marker or re.search(r"python_version\s*<\s*.3\.(\d|1[01])\b", marker):
                continue
            if "platform" not in marker and (name := _plain(name)) not in needed:
                needed.add(name)
                left.append(name)
    assert set(map(_plain, named)) == needed


def test_help_loads_neither_an_event_loop_nor_the_protocols() -> None:
    """A small computer takes a second for these."""
    program = "import sys; from gateway.cli import main; sys.argv[1:] = ['--help']\ntry: main()\nexcept SystemExit: "
    program += "print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE, check=True)
    loaded = done.stderr.split()
    assert "nexstar" in done.stdout and "run  " in done.stdout
    assert not {"asyncio", "msgspec", "gateway.protocols.registry"} & set(loaded)
    assert sum(name.startswith("gateway") for name in loaded) < 15


#: A gateway that writes the names of all packages it has imported to a file, when it is sent SIGUSR1.
PROGRAM = """
import signal, sys
def tell(number, frame):
    names = sorted(sys.modules)
    with open(sys.argv[1] + ".new", "w") as file:
        file.write(" ".join(names))
    import os
    os.replace(sys.argv[1] + ".new", sys.argv[1])
signal.signal(signal.SIGUSR1, tell)
from gateway.astro.ephemeris import keeper
from gateway.cli import main
keeper.gateway_argv = lambda: sys.argv[2].split("|")
sys.exit(main(sys.argv[3:]))
"""
#: What every gateway may import that others have made, what a page and programs over HTTP need, and what a broker does.
ALWAYS = {"msgspec", "platformdirs", "serial", "tomli", "typing_extensions", "uvloop"}
PAGE = {"aiohappyeyeballs", "aiohttp", "aiosignal", "attr", "attrs", "backports", "frozenlist", "idna", "multidict",
        "propcache", "yarl"}  # fmt: skip
BROKER = {"aiomqtt", "paho"}
#: What the first answer does not need: each takes a part of the quarter of a second within which it comes.
LATER = {
    "bz2", "gateway.app.pages", "gateway.console", "gateway.diagnostics.detect", "gateway.diagnostics.rehearsal",
    "gateway.fleet", "gateway.protocols.alpaca.surface", "gateway.protocols.lx200.driver",
    "gateway.protocols.nexstar.surface", "gateway.protocols.stellarium.surface",
    "gateway.transport.pty", "lzma", "platformdirs", "random", "secrets", "shutil", "tempfile",
}  # fmt: skip


#: Seconds until the first almanac is there, on a computer that has much other work to do.
CALCULATED = 130.0


class Weighed(Running):
    """A gateway, and the packages it has imported."""

    def __init__(self, place: Path, *more: str) -> None:
        self.list = place / "modules"
        words = ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", *more]
        super().__init__(*words, by=[sys.executable, "-bb", "-c", PROGRAM, str(self.list), "|".join(EAGER)])

    def console(self) -> str:
        assert self.process.stdout is not None
        return next(line.split()[2] for line in self.process.stdout if line.startswith("ready console "))

    def modules(self) -> set[str]:
        self.list.unlink(missing_ok=True)
        self.process.send_signal(signal.SIGUSR1)
        end = time.monotonic() + PATIENCE
        while not self.list.exists():
            assert time.monotonic() < end
            time.sleep(0.01)
        return set(self.list.read_text().split())

    def packages(self) -> set[str]:
        others = {name for name in packages_distributions() if name[0] != "_" and "__mypyc" not in name} - {"gateway"}
        return others & {name.partition(".")[0] for name in self.modules()}


def page(host: str, port: int) -> bytes:
    """What a browser reads there, the head of the reply included."""
    with socket.create_connection((host, port), PATIENCE) as browser:
        browser.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
        return b"".join(iter(lambda: browser.recv(65536), b""))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGUSR1")
def test_serving_gateway_imports_neither_astropy_nor_numpy(
    tmp_path: Path, started: list[Running], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither astropy nor numpy, not even for its first almanac; aiohttp when a page is opened."""
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path / "cache"))
    mount = Weighed(tmp_path, "--console", "tcp://127.0.0.1:0")
    started.append(mount)
    surface = mount.ready()
    console = mount.console()
    assert ask(surface, b":GR#").endswith(b"#")
    assert LATER & mount.modules() <= ({"platformdirs"} if sys.platform != "linux" else set())
    assert mount.packages() <= ALWAYS, "with no page"
    host, port = console.removeprefix("http://").rstrip("/").split(":")
    with socket.create_connection((host, int(port)), PATIENCE):
        assert mount.packages() <= ALWAYS, "somebody has connected, and sent nothing"
    # A computer with much other work to do takes longer over aiohttp than a page is kept waiting.
    while (heard := page(host, int(port))).startswith(b"HTTP/1.1 503") and b"Load this page again" in heard:
        pass
    assert heard.startswith(b"HTTP/1.1 200") and b"</html>" in heard
    end = time.monotonic() + CALCULATED
    while not (tmp_path / "cache" / "almanac").exists():
        assert time.monotonic() < end, "its process has calculated no almanac"
        time.sleep(0.05)
    assert mount.packages() <= ALWAYS | PAGE, "with a page, and an almanac"
    assert "aiohttp" in mount.packages()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGUSR1")
def test_gateway_with_a_broker_imports_only_the_broker_client(tmp_path: Path, started: list[Running]) -> None:
    pytest.importorskip("aiomqtt")
    with socket.create_server(("127.0.0.1", 0)) as broker:
        at = f"mqtt://127.0.0.1:{broker.getsockname()[1]}"
        mount = Weighed(tmp_path, "--no-console", "--mqtt", at, "--mqtt-id", "pier")
        started.append(mount)
        mount.ready()
        broker.settimeout(PATIENCE)
        broker.accept()[0].close()  # it has loaded what it needs to connect
        assert mount.packages() <= ALWAYS | BROKER
