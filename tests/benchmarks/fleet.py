"""What a broker costs gateways, and how fast it tells, stops and comes back.

    python tests/benchmarks/fleet.py [--seconds 30] [--outage 60] [--only PART ...]

Needs mosquitto. ``load``: 50 slewing mounts over 5 gateways at one state a second, with a broker and without, in turn.
``killed``: from ``kill -9`` until a subscriber knows. ``stop``: STOP ALL of the overview's page until the first stopping
byte on each of 50 lines. ``outage``: a program polls, guides, slews and stops while the broker is there, is ended for a
minute, and is there again. ``thousand``: 1,000 mounts of a script on one broker, and the overview's page over them.
"""

from __future__ import annotations

import argparse
import json
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.benchmarks.figures import middle, percentile
from tests.benchmarks.fleet_processes import GOTO, Broker, Gateway, Onlooker, until, used
from tests.benchmarks.memory import resident
from tests.benchmarks.processes import HOST, ROOT, end, environment

GATEWAYS, MOUNTS = 5, 10


def is_stop(request: bytes) -> bool:
    """Whether a command to the hand control ends a motion: ``M``, or a fixed rate of 0."""
    return request[:1] == b"M" or (request[:1] == b"P" and request[3:4] in (b"\x24", b"\x25") and request[4:5] == b"\0")


def slew(gateways: list[Gateway]) -> None:
    """Every mount begins to move."""
    for gateway in gateways:
        for port in gateway.ports:
            with socket.create_connection((HOST, port), 20.0) as link:
                link.settimeout(20.0)
                link.sendall(GOTO)
                heard = b""
                while len(heard) < 3:
                    heard += link.recv(10)
                assert heard == b"110", heard


class Page:
    """The overview, and a browser that has its page."""

    def __init__(self, folder: Path, broker: Broker) -> None:
        (own := folder / "fleet").mkdir(exist_ok=True)
        command = [sys.executable, "-m", "gateway", "fleet", "--mqtt", broker.url, "--port", "0"]
        self.process = subprocess.Popen(command, cwd=ROOT, env=environment(str(own)), stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.where = self.process.stdout.readline().split()[-1]
        with urllib.request.urlopen(self.where, timeout=20.0) as answer:
            self._token = answer.read().decode().split('name="token" content="')[1].split('"')[0]

    def ask(self, path: str, body: bytes | None = None) -> dict[str, object]:
        request = urllib.request.Request(self.where + path, body, {"X-Token": self._token})
        with urllib.request.urlopen(request, timeout=20.0) as answer:
            return dict(json.loads(answer.read()))

    def end(self) -> None:
        end(self.process)


def load(folder: Path, seconds: float) -> None:
    """Processor time of the gateways."""
    broker, rates = Broker(folder), dict[bool, list[float]]()
    onlooker = Onlooker(broker)
    for number in range(4):
        shown = number % 2 == 1
        made = [Gateway(folder, f"load{number}-{one}", MOUNTS, broker.url if shown else None)
                for one in range(GATEWAYS)]  # fmt: skip
        try:
            time.sleep(10.0)  # the sky is loaded
            slew(made)
            time.sleep(2.0)
            before, heard, began = [one.seconds_used() for one in made], len(onlooker.heard), time.monotonic()
            time.sleep(seconds)
            took = time.monotonic() - began
            spent = sum(one.seconds_used() - then for one, then in zip(made, before, strict=True))
            rates.setdefault(shown, []).append(100.0 * spent / took / GATEWAYS)
            print(f"  {'with' if shown else 'without'} broker: {rates[shown][-1]:.2f} % of a core a gateway, "
                  f"{(len(onlooker.heard) - heard) / took:.0f} messages/s, "
                  f"{middle([resident(one.process.pid) for one in made]):.0f} MiB a gateway", flush=True)  # fmt: skip
        finally:
            for one in made:
                one.end()
    print(f"load: + {middle(rates[True]) - middle(rates[False]):.2f} % of a core a gateway of {MOUNTS} mounts")
    onlooker.leave()
    broker.end()


def killed(folder: Path, seconds: float) -> None:
    """From ``kill -9`` to ``offline``."""
    broker, took = Broker(folder), list[float]()
    onlooker = Onlooker(broker)
    for number in range(5):
        topic = f"mount-gateway/killed{number}/availability"
        one = Gateway(folder, f"killed{number}", 2, broker.url)
        until("it is there", lambda: onlooker.newest(topic) == b"online")  # noqa: B023
        began = time.time()
        one.process.send_signal(signal.SIGKILL)
        until("it is gone", lambda: onlooker.newest(topic) == b"offline")  # noqa: B023
        took.append(
            next(at for at, where, said in reversed(onlooker.heard) if (where, said) == (topic, b"offline")) - began
        )
        one.process.wait(5.0)
    print(f"killed: known after {1e3 * middle(took):.1f} ms, at most {1e3 * max(took):.1f} ms, of {len(took)}")
    onlooker.leave()
    broker.end()


def stop(folder: Path, seconds: float) -> None:
    """From STOP ALL on the page to every mount's line."""
    broker, took = Broker(folder), list[float]()
    made = [Gateway(folder, f"stop{one}", MOUNTS, broker.url, log=True) for one in range(GATEWAYS)]
    page = Page(folder, broker)
    try:
        time.sleep(10.0)
        for _ in range(10):
            slew(made)
            time.sleep(1.0)
            began = time.time()
            assert page.ask("stop", b"{}")["sent"] is True
            time.sleep(2.0)
            for one in made:
                first: dict[str, float] = {}
                for at, mount, sent in list(one.commands):
                    if at >= began - 0.001 and is_stop(sent):
                        first.setdefault(mount, at - began)
                assert len(first) == MOUNTS, f"{len(first)} of {MOUNTS} were stopped"
                took += first.values()
    finally:
        page.end()
        for one in made:
            one.end()
        broker.end()
    print(f"stop: {1e3 * middle(took):.0f} ms, p99 {1e3 * percentile(took, 99):.0f} ms, at most {1e3 * max(took):.0f} ms, "
          f"of {len(took)} stops")  # fmt: skip


def outage(folder: Path, seconds: float) -> None:
    """Position and stop of a program while the broker is there, and while it is not."""
    broker = Broker(folder)
    onlooker = Onlooker(broker)
    one = Gateway(folder, "outage", 1, broker.url, log=True, nice=-5)
    topic = "mount-gateway/outage/m0/state"
    times: dict[str, tuple[list[float], list[float]]] = {}
    try:
        time.sleep(10.0)
        for phase in ("there", "ended", "there again", "hung", "there at last"):
            if phase in ("ended", "hung"):
                broker.process.send_signal(signal.SIGSTOP) if phase == "hung" else broker.end()
            elif phase != "there":
                began = time.time()
                broker.process.send_signal(signal.SIGCONT) if phase == "there at last" else broker.start()
                until("the state is told again", lambda: onlooker.newest(topic) and any(
                    at > began and where == topic and abs(json.loads(said)["time"] - at) < 1.5
                    for at, where, said in onlooker.heard[-50:]))  # fmt: skip
                print(f"  the newest state was told {time.time() - began:.2f} s after its return", flush=True)
            times[phase] = _played(one, seconds)
            positions, stops = times[phase]
            print(f"  {phase}: :GR# {1e6 * middle(positions):.0f} µs, p99 {1e6 * percentile(positions, 99):.0f} µs of "
                  f"{len(positions)}; stop {1e3 * middle(stops):.1f} ms, p99 {1e3 * percentile(stops, 99):.1f} ms of "
                  f"{len(stops)}", flush=True)  # fmt: skip
    finally:
        broker.process.send_signal(signal.SIGCONT)
        one.end()
        onlooker.leave()
        broker.end()


def _played(gateway: Gateway, seconds: float) -> tuple[list[float], list[float]]:
    """A program that polls, guides, slews and stops -> how long positions took, and stops until their first byte."""
    positions, asked = list[float](), list[float]()
    with socket.create_connection((HOST, gateway.ports[0]), 20.0) as link:
        link.settimeout(20.0)
        until_then, number = time.monotonic() + seconds, 0
        while time.monotonic() < until_then:
            number += 1
            began = time.perf_counter()
            link.sendall(b":GR#")
            heard = b""
            while not heard.endswith(b"#"):
                heard += link.recv(100)
            positions.append(time.perf_counter() - began)
            if number % 50 == 10:
                link.sendall(b":Mgn0200#")
            elif number % 50 == 25:
                link.sendall(GOTO)
                heard = b""
                while len(heard) < 3:
                    heard += link.recv(10)
            elif number % 50 == 45:
                asked.append(time.time())
                link.sendall(b":Q#")
            time.sleep(0.02)
    time.sleep(1.0)
    commands = list(gateway.commands)
    stops = [min((at - then for at, _, sent in commands if at >= then - 0.001 and is_stop(sent)), default=9.0)
             for then in asked]  # fmt: skip
    return positions, stops


def thousand(folder: Path, seconds: float) -> None:
    """1,000 mounts of a script at one broker, one state a second each, and the overview's page over them."""
    broker = Broker(folder)
    state = {"online": True, "does": "tracking", "ra_hours": 1.0, "dec_degrees": 2.0, "altitude_degrees": 3.0,
             "azimuth_degrees": 4.0, "tracking": True, "moving": True, "aligned": True, "asleep": False, "held": False,
             "product": "Celestron NexStar", "model": "6-8se", "version": "4.21", "programs": 1,
             "line": {"state": "up", "reason": "", "answer_seconds": 0.02}}  # fmt: skip
    publishers = [Onlooker(broker, "nothing") for _ in range(100)]
    page, counter = Page(folder, broker), Onlooker(broker, "mount-gateway/+/+/state")
    try:
        for number, one in enumerate(publishers):
            one.say(f"mount-gateway/g{number}/availability", b"online", True)
        before = used(broker.process.pid), used(page.process.pid), time.monotonic()
        late, turns = list[float](), int(seconds)
        looks = list[float]()
        for turn in range(turns):
            due = before[2] + turn
            time.sleep(max(0.0, due - time.monotonic()))
            for mount in range(10):
                for number, one in enumerate(publishers):
                    told = json.dumps({**state, "ra_hours": turn / 1000.0, "time": round(time.time(), 3)}).encode()
                    one.say(f"mount-gateway/g{number}/m{mount}/state", told, True)
            late.append(time.monotonic() - due)
            began = time.perf_counter()
            page.ask("fleet.json")
            looks.append(time.perf_counter() - began)
        until("all is heard", lambda: len(counter.heard) >= 1000 * turns)
        took = time.monotonic() - before[2]
        shown = page.ask("fleet.json")["mounts"]
        assert isinstance(shown, list)
        print(f"thousand: {len(counter.heard) / took:.0f} states/s told and heard ({len(shown)} mounts on the page); "
              f"publishing took {middle(late):.2f} s of a second; broker {100 * (used(broker.process.pid) - before[0]) / took:.1f} % "
              f"of a core, {resident(broker.process.pid):.1f} MiB; page {100 * (used(page.process.pid) - before[1]) / took:.1f} % "
              f"of a core, {resident(page.process.pid):.0f} MiB, asked in {1e3 * middle(looks):.0f} ms")  # fmt: skip
    finally:
        for one in (*publishers, counter):
            one.leave()
        page.end()
        broker.end()


PARTS = {"load": load, "killed": killed, "stop": stop, "outage": outage, "thousand": thousand}


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Measure gateways on a broker.")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each measurement")
    parser.add_argument("--outage", type=float, default=60.0, help="of each phase of the outage")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    arguments = parser.parse_args()
    for name in arguments.only:
        with tempfile.TemporaryDirectory(prefix="mount-gateway-bench-") as folder:
            PARTS[name](Path(folder), arguments.outage if name == "outage" else arguments.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
