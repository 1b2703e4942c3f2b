"""What is needed to be let in by a broker, what is told where that is missing, and a broker of MQTT 3.1.1 alone."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.app.config import Source, make_config
from gateway.app.config.endpoints import Broker, parse_broker
from gateway.core.errors import UserError
from gateway.fleet import client as accesses
from gateway.fleet.client import PASSWORD_VARIABLE, get_access, make_connector
from gateway.fleet.topics import Topics, host_id
from tests.support.each import each

pytest.importorskip("aiomqtt")

WHOLE = {"mount": [{"at": "nexstar@sim"}], "surface": [{"at": "lx200@tcp://:4030"}]}


@each(
    ("text", "broker"),
    [
        ("mqtt://127.0.0.1", Broker("127.0.0.1", 1883, False)),
        ("mqtt://pi.local:1884/", Broker("pi.local", 1884, False)),
        ("mqtts://club.example.org", Broker("club.example.org", 8883, True)),
        ("mqtt://[::1]:1883", Broker("::1", 1883, False)),
        ("mqtt://eve@pi", Broker("pi", 1883, False, "eve")),
    ],
)
def test_broker_address_gives_scheme_host_port_and_user(text: str, broker: Broker) -> None:
    assert parse_broker(text) == broker
    assert parse_broker(str(broker)).port == broker.port


@each("text", ["", "pi:1883", "tcp://pi", "mqtt://", "mqtt://pi:x", "mqtt://pi/topic", "mqtt://[::1"])
def test_invalid_broker_address_is_refused_with_a_valid_one(text: str) -> None:
    with pytest.raises(UserError, match="write mqtt://HOST:PORT"):
        parse_broker(text)


def test_password_in_a_broker_address_is_refused_and_not_repeated() -> None:
    with pytest.raises(UserError, match="password-file") as told:
        parse_broker("mqtt://eve:secret@pi")
    assert "secret" not in str(told.value)


def test_broker_password_comes_from_a_file_or_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (file := tmp_path / "password").write_text("from file\n")
    monkeypatch.setenv(PASSWORD_VARIABLE, "from environment")
    assert get_access("mqtt://pi", "eve").password == "from environment"
    assert get_access("mqtt://pi", "eve", str(file)).password == "from file"
    assert get_access("mqtt://adam@pi", None, str(file)).user == "adam"
    with pytest.raises(UserError, match="no such file"):
        get_access("mqtt://pi", "eve", str(tmp_path / "none"))
    with pytest.raises(UserError, match="write user under"):
        get_access("mqtt://pi")


def test_unusable_broker_certificates_are_reported_before_connecting(tmp_path: Path) -> None:
    (file := tmp_path / "ca.pem").write_text("no certificate")
    assert get_access("mqtts://pi").tls_context() is not None and get_access("mqtt://pi").tls_context() is None
    with pytest.raises(UserError, match="no certificates"):
        get_access("mqtts://pi", ca=str(file))
    with pytest.raises(UserError, match="No such file"):
        get_access("mqtts://pi", ca=str(tmp_path / "none"))


def test_missing_mqtt_extra_is_reported_with_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accesses, "find_spec", lambda name: None)
    with pytest.raises(UserError, match=r"aiomqtt is needed; to install it, .*mqtt"):
        get_access("mqtt://pi")


@each(
    ("keys", "words"),
    [
        ({"at": "pi"}, r"\[mqtt\] at: 'pi': write mqtt://HOST:PORT"),
        ({"at": "mqtt://pi", "id": "all"}, r"\[mqtt\] id: 'all' means every gateway"),
        ({"at": "mqtt://pi", "id": "a/b"}, r"\[mqtt\] id: .*write a word of letters"),
        ({"at": "mqtt://pi", "prefix": "a/#"}, r"\[mqtt\] prefix: .*write words of letters"),
        ({"at": "mqtt://pi", "ca": "ca.pem"}, r"\[mqtt\] ca: certificates are for TLS"),
        ({"at": "mqtt://pi", "orders": ["dance"]}, r"\[mqtt\] orders: .*one of park, wake, home, goto"),
        ({"at": "mqtt://pi", "password": "secret"}, r"\[mqtt\] password: there is no such key"),
        ({}, r"\[mqtt\] at: is needed"),
    ],
)
def test_mistakes_in_the_mqtt_settings_are_reported_with_their_place(keys: dict[str, object], words: str) -> None:
    with pytest.raises(UserError, match=words):
        make_config({**WHOLE, "mqtt": keys}, Source("gateway.toml"))


def test_mqtt_topics_contain_only_allowed_characters(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "Pi #4/dome")
    assert host_id() == "Pi-4-dome"
    monkeypatch.setattr("socket.gethostname", lambda: "all")
    assert host_id() != "all"
    topics = Topics("a/b", "pier")
    assert topics.levels_of("a/b/pier/mount/command") == ["pier", "mount", "command"] and topics.levels_of("a/bc") == []


#: CONNACK of 3.1.1, OASIS table 3.1: unacceptable protocol level; accepted.
UNACCEPTABLE, ACCEPTED = b"\x20\x02\x00\x01", b"\x20\x02\x00\x00"


def test_broker_without_mqtt_5_is_used_with_the_older_version() -> None:
    levels: list[int] = []

    async def old_broker(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        sent = await reader.read(1024)
        level = sent[sent.index(b"MQTT") + 4]
        levels.append(level)
        writer.write(ACCEPTED if level == 4 else UNACCEPTABLE)
        while level == 4 and await reader.read(1024):
            pass
        writer.close()

    async def main() -> None:
        server = await asyncio.start_server(old_broker, "127.0.0.1", 0)
        async with server:
            connect = make_connector(get_access(f"mqtt://127.0.0.1:{server.sockets[0].getsockname()[1]}"))
            with pytest.raises(Exception, match="protocol"):
                async with connect(None):
                    raise AssertionError("it was accepted")
            async with connect(None):
                pass

    asyncio.run(main())
    assert levels == [5, 4]
