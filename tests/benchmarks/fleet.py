"""What a broker costs gateways, and how fast it publishes, stops and recovers.

    python tests/benchmarks/fleet.py [--seconds 30] [--outage 60] [--only PART ...]

It needs mosquitto. ``load``: 50 slewing mounts over 5 gateways on a broker, and as many without one, at the same time.
``killed``: from ``kill -9`` until a subscriber knows. ``stop``: from STOP ALL on the overview's page until the first
stopping byte on each of 50 lines. ``outage``: a program polls, guides, slews and stops on a gateway with a broker and
on one without, in turn, while the broker runs, is ended, runs again, hangs, and runs again. ``thousand``: 1,000 mounts
of a script on one broker, and the overview's page over them.
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
from collections.abc import Callable
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
    """Start a slew of every mount."""
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
    """Measure processor time and memory of gateways with a broker and without, in the same seconds."""
    broker = Broker(folder)
    onlooker = Onlooker(broker)
    shown = [Gateway(folder, f"shown{one}", MOUNTS, broker.url) for one in range(GATEWAYS)]
    alone = [Gateway(folder, f"alone{one}", MOUNTS, None) for one in range(GATEWAYS)]
    every = [*shown, *alone]
    try:
        time.sleep(15.0)  # until it is at rest
        slew(every)
        time.sleep(2.0)
        before, heard, began = [one.seconds_used() for one in every], len(onlooker.heard), time.monotonic()
        time.sleep(seconds)
        took = time.monotonic() - began
        shares = [100.0 * (one.seconds_used() - then) / took for one, then in zip(every, before, strict=True)]
        for name, ones in (("with a broker", shown), ("without", alone)):
            share = sum(shares[every.index(one)] for one in ones) / GATEWAYS
            memory = middle([resident(one.process.pid) for one in ones])
            print(f"load: {name}: {share:.2f} % of a core and {memory:.0f} MiB a gateway of {MOUNTS} mounts")
        print(f"  {(len(onlooker.heard) - heard) / took:.0f} messages/s, broker {resident(broker.process.pid):.1f} MiB")
    finally:
        for one in every:
            one.end()
        onlooker.leave()
        broker.end()


def killed(folder: Path, seconds: float) -> None:
    """Measure the time from ``kill -9`` to ``offline``."""
    broker, took = Broker(folder), list[float]()
    onlooker = Onlooker(broker)
    for number in range(5):
        topic = f"mount-gateway/killed{number}/availability"
        one = Gateway(folder, f"killed{number}", 2, broker.url)
        until("the gateway is online", lambda: onlooker.newest(topic) == b"online")  # noqa: B023
        began = time.time()
        one.process.send_signal(signal.SIGKILL)
        until("the gateway is offline", lambda: onlooker.newest(topic) == b"offline")  # noqa: B023
        heard = [at for at, where, said in onlooker.heard if (where, said) == (topic, b"offline")]
        took.append(heard[-1] - began)
        one.process.wait(5.0)
    print(f"killed: known after {1e3 * middle(took):.1f} ms, at most {1e3 * max(took):.1f} ms, of {len(took)}")
    onlooker.leave()
    broker.end()


def stop(folder: Path, seconds: float) -> None:
    """Measure the time from STOP ALL on the page to every mount's line."""
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
    at_most = f"p99 {1e3 * percentile(took, 99):.0f} ms, at most {1e3 * max(took):.0f} ms"
    print(f"stop: {1e3 * middle(took):.0f} ms, {at_most}, of {len(took)} stops")


def outage(folder: Path, seconds: float) -> None:
    """Measure a program's positions and stops while the broker runs, and while it does not."""
    broker = Broker(folder)
    onlooker = Onlooker(broker)
    shown = Gateway(folder, "shown", 1, broker.url, log=True, nice=-5)
    alone = Gateway(folder, "alone", 1, None, log=True, nice=-5)
    try:
        time.sleep(10.0)
        for phase in ("there", "ended", "there again", "hung", "there at last"):
            if phase in ("ended", "hung"):
                broker.process.send_signal(signal.SIGSTOP) if phase == "hung" else broker.end()
            elif phase != "there":
                since = time.time()
                broker.process.send_signal(signal.SIGCONT) if phase == "there at last" else broker.start()
                until("the state is published again", lambda: _right(onlooker, since))  # noqa: B023
                print(f"  the newest state was published {time.time() - since:.2f} s after its return", flush=True)
            plays = [_Play(shown), _Play(alone)]
            until_then, order = time.monotonic() + seconds, [*plays]
            while time.monotonic() < until_then:
                for play in order:
                    play.go_on()
                order.reverse()  # the first of the two waits longer for the same
                time.sleep(0.01)
            time.sleep(1.0)
            for name, play in zip(("with a broker", "without"), plays, strict=True):
                print(f"  {phase}, {name}: {play.ended()}", flush=True)
    finally:
        broker.process.send_signal(signal.SIGCONT)
        shown.end()
        alone.end()
        onlooker.leave()
        broker.end()


def _right(onlooker: Onlooker, since: float) -> bool:
    """Whether a state has arrived since then that was made just now."""
    topic = "mount-gateway/shown/m0/state"
    recent = [(at, said) for at, where, said in onlooker.heard[-50:] if where == topic and at > since]
    return any(abs(json.loads(said)["time"] - at) < 1.5 for at, said in recent)


class _Play:
    """A program that polls, guides, slews and stops, one step per call."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._link = socket.create_connection((HOST, gateway.ports[0]), 20.0)
        self._link.settimeout(20.0)
        self._number = 0
        self._positions, self._stops = list[float](), list[float]()

    def go_on(self) -> None:
        """Ask for the position; now and then do something else."""
        began = time.perf_counter()
        self._ask(b":GR#", lambda heard: heard.endswith(b"#"))
        self._positions.append(time.perf_counter() - began)
        self._number += 1
        match self._number % 15:
            case 3:
                self._link.sendall(b":Mgn0200#")
            case 7:
                self._ask(GOTO, lambda heard: len(heard) >= 3)
            case 12:
                self._stops.append(time.time())
                self._link.sendall(b":Q#")

    def _ask(self, command: bytes, whole: Callable[[bytes], bool]) -> None:
        self._link.sendall(command)
        heard = b""
        while not whole(heard):
            heard += self._link.recv(100)

    def ended(self) -> str:
        """Return the results: times of positions, and of stops until their first byte on the mount's line."""
        self._link.close()
        sent = [at for at, _, sent in list(self._gateway.commands) if is_stop(sent)]
        took = [min((at - asked for at in sent if at >= asked - 0.001), default=9.0) for asked in self._stops]
        times = self._positions
        return (
            f":GR# {1e6 * middle(times):.0f} µs, p99 {1e6 * percentile(times, 99):.0f} µs of {len(times)}; "
            f"stop {1e3 * middle(took):.1f} ms, p99 {1e3 * percentile(took, 99):.1f} ms of {len(took)}"
        )


def thousand(folder: Path, seconds: float) -> None:
    """Measure 1,000 mounts of a script on one broker, one state a second each, and the overview's page over them."""
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
        print(f"thousand: {len(counter.heard) / took:.0f} states/s sent and received, {len(shown)} mounts on the page, "
              f"asked in {1e3 * middle(looks):.0f} ms; publishing took {middle(late):.2f} s of a second")  # fmt: skip
        for name, process, then in (("broker", broker.process, before[0]), ("page", page.process, before[1])):
            share = 100.0 * (used(process.pid) - then) / took
            print(f"  {name}: {share:.1f} % of a core, {resident(process.pid):.1f} MiB")
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
