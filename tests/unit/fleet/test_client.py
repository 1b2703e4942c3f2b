"""The client of a broker that knows MQTT 3.1.1 alone: MQTT 5 is refused once, and then the older one is spoken."""

from __future__ import annotations

import asyncio

import pytest

from gateway.fleet.client import access, connecting

#: CONNACK of 3.1.1, OASIS table 3.1: unacceptable protocol level; accepted.
UNACCEPTABLE, ACCEPTED = b"\x20\x02\x00\x01", b"\x20\x02\x00\x00"


def test_a_broker_that_does_not_know_mqtt_5_is_spoken_to_in_the_older_one() -> None:
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
            connect = connecting(access(f"mqtt://127.0.0.1:{server.sockets[0].getsockname()[1]}"))
            with pytest.raises(Exception, match="protocol"):
                async with connect(None):
                    raise AssertionError("it was accepted")
            async with connect(None):
                pass

    asyncio.run(main())
    assert levels == [5, 4]
