"""Gateways on a real broker: shown, stopped, killed, locked out; and a broker that goes, sends too much, returns."""

from __future__ import annotations

import signal
import subprocess
import time

from gateway.fleet.client import ANSWER_TIMEOUT, KEEPALIVE_PERIOD
from tests.support.process import GATEWAY, ask

from .mosquitto import Broker, Onlooker, folder
from .processes import Process, Workshop, requires, wait_until

EVENT = "mount-gateway/pier/mount/event"
STATE, COMMAND, HERE = "mount-gateway/pier/mount/state", "mount-gateway/pier/mount/command", (
    "mount-gateway/pier/availability"
)  # fmt: skip


def gateway(workshop: Workshop, *flags: str, url: str, password: str = "") -> tuple[Process, str]:
    """One that is called ``pier`` there -> it, and where programs connect."""
    process = workshop.start(
        [*GATEWAY, "run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--no-console", "--speed",
         "6", "--sun", "0", "--mqtt", url, "--mqtt-id", "pier", *flags],
        {**folder(workshop.folder / "state"), "MOUNT_GATEWAY_MQTT_PASSWORD": password},
    )  # fmt: skip
    [ready] = process.wait_for_lines("ready lx200", 1)
    return process, ready.partition("@")[2].split()[0]


def test_broker_shows_moves_and_stops_a_mount(workshop: Workshop) -> None:
    broker = Broker(workshop)
    onlooker = Onlooker(workshop, broker)
    process, _ = gateway(workshop, url=broker.url)
    wait_until("the mount is shown", lambda: onlooker.state(STATE).get("aligned"))
    onlooker.say(COMMAND, "park")
    wait_until("it moves", lambda: onlooker.state(STATE)["moving"])
    onlooker.say("mount-gateway/all/command", "stop")
    wait_until("it stands", lambda: not onlooker.state(STATE)["moving"])
    late = Onlooker(workshop, broker)
    wait_until("who comes later sees it, too", lambda: late.told(STATE) and late.told(HERE) == [b"online"])
    process.signal(signal.SIGKILL)
    since = time.monotonic()
    wait_until("it is known to be gone", lambda: onlooker.told(HERE)[-1] == b"offline")
    assert onlooker.when(HERE, b"offline") - since < KEEPALIVE_PERIOD, "by its last will, not as one that is silent"
    gateway(workshop, url=broker.url)
    wait_until("it is there again", lambda: onlooker.told(HERE)[-1] == b"online")


def test_mqtt_broker_outage_delays_no_answer_and_status_is_sent_afterwards(workshop: Workshop) -> None:
    broker = Broker(workshop)
    process, where = gateway(workshop, url=broker.url)
    process.wait_for_lines("ready broker", 1)
    broker.end()
    wait_until("it is told", lambda: "cannot be reached" in process.output())
    for _ in range(20):
        began = time.monotonic()
        ask(where, b":GR#")
        assert time.monotonic() - began < ANSWER_TIMEOUT, "it does not wait for the broker"
    broker.again()
    onlooker = Onlooker(workshop, broker)
    wait_until("it is shown again", lambda: onlooker.state(STATE).get("online"))
    assert onlooker.told(HERE)[-1] == b"online"
    assert process.output().count("cannot be reached") == 1


def test_retained_order_of_a_broker_is_never_obeyed(workshop: Workshop) -> None:
    broker = Broker(workshop)
    onlooker = Onlooker(workshop, broker)
    process, _ = gateway(workshop, url=broker.url)
    process.wait_for_lines("ready broker", 1)
    wait_until("the mount is shown", lambda: onlooker.state(STATE).get("aligned"))
    onlooker.say(COMMAND, "park", retain=True)
    wait_until("it is refused", lambda: any(b"retain flag" in told for told in onlooker.told(EVENT)))
    assert not onlooker.state(STATE)["moving"]
    onlooker.say(COMMAND, b"", retain=True)


def test_overlong_broker_message_is_rejected(workshop: Workshop) -> None:
    broker = Broker(workshop)
    process, where = gateway(workshop, url=broker.url)
    process.wait_for_lines("ready broker", 1)
    onlooker = Onlooker(workshop, broker)
    onlooker.say("mount-gateway/all/command", b"x" * 20_000_000)
    onlooker.say(COMMAND, b"stop")
    wait_until("the stop is carried out", lambda: any(b"stop" in told for told in onlooker.told(EVENT)))
    assert ask(where, b":GR#")
    assert "is connected again" not in process.output(), "the link has stayed"


def test_two_gateways_with_one_broker_id_both_report_it(workshop: Workshop) -> None:
    broker = Broker(workshop)
    first, _ = gateway(workshop, url=broker.url)
    first.wait_for_lines("ready broker", 1)
    second, _ = gateway(workshop, url=broker.url)
    for process in (first, second):
        wait_until("it is told", lambda: "has the ID 'pier' on the broker, too" in process.output())  # noqa: B023
    second.end()
    onlooker = Onlooker(workshop, broker)
    wait_until("the first is still shown", lambda: onlooker.told(HERE)[-1:] == [b"online"])


def test_gateway_connects_to_a_broker_with_passwords_and_certificates(workshop: Workshop) -> None:
    requires("openssl", "mosquitto_passwd")
    here = workshop.folder
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", "key.pem", "-out", "cert.pem", "-days",
         "2", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"],
        cwd=here, check=True, capture_output=True, timeout=60,
    )  # fmt: skip
    subprocess.run(["mosquitto_passwd", "-b", "-c", "users", "eve", "secret"], cwd=here, check=True, timeout=60)
    for name in ("key.pem", "users"):
        (here / name).chmod(0o644)
    broker = Broker(
        workshop, f"certfile {here / 'cert.pem'}", f"keyfile {here / 'key.pem'}", f"password_file {here / 'users'}"
    )
    url = f"mqtts://eve@127.0.0.1:{broker.port}"
    (file := here / "gateway.toml").write_text(f'[mqtt]\nat = "{url}"\nca = "{here / "cert.pem"}"\n')
    known, _ = gateway(workshop, "--config", str(file), url=url, password="secret")
    known.wait_for_lines("ready broker mqtts://127.0.0.1", 1)
    locked_out, where = gateway(workshop, "--config", str(file), url=url, password="guess")
    wait_until("it is told", lambda: "it refuses the user or the password" in locked_out.output())
    assert ask(where, b":GR#") and "secret" not in known.output()
    (file).write_text(f'[mqtt]\nat = "{url}"\n')
    doubtful, where = gateway(workshop, "--config", str(file), url=url, password="secret")
    wait_until("it is told", lambda: "certificate" in doubtful.output())
    assert ask(where, b":GR#")
