"""Programs that ask everybody on the network for Alpaca ports are told of those that they reach."""

from __future__ import annotations

import asyncio
import json
import socket
from contextlib import closing

import pytest

from gateway.app.discovery.answering import DiscoveryAnswers
from gateway.app.discovery.offer import Offer
from gateway.protocols.alpaca.http import discovery
from gateway.protocols.alpaca.http.discovery import DISCOVERY_REQUEST, answer_discovery, discovery_replies
from tests.support.each import each

pytestmark = pytest.mark.real_time
EVERYWHERE, HERE = ("0.0.0.0", 11111), ("127.0.0.1", 4040)


def ports(places: list[tuple[str, int]], asker: str, question: bytes = DISCOVERY_REQUEST) -> list[int]:
    return [json.loads(reply)["AlpacaPort"] for reply in discovery_replies(question, places, asker)]


def test_alpaca_discovery_answers_only_ports_that_the_asker_reaches() -> None:
    assert ports([EVERYWHERE, HERE], "192.0.2.7") == [11111], "another computer does not reach the second one"
    assert ports([EVERYWHERE, HERE], "127.0.0.1") == [11111, 4040]
    assert ports([EVERYWHERE], "192.0.2.7", b"alpacadiscovery1 and more") == [11111]
    assert ports([EVERYWHERE], "192.0.2.7", b"alpacadiscovery2") == []
    assert ports([EVERYWHERE], "192.0.2.7", b"") == []
    assert ports([EVERYWHERE], "2001:db8::7") == [] and ports([("::", 11111)], "2001:db8::7") == [11111]
    assert ports([("::", 11111)], "192.0.2.7") == [11111], "both kinds arrive there"


@each(("family", "host", "place"), [(socket.AF_INET, "127.0.0.1", EVERYWHERE),
                                                      (socket.AF_INET6, "::1", ("::", 11111))])  # fmt: skip
def test_two_alpaca_servers_share_the_discovery_port(
    family: socket.AddressFamily, host: str, place: tuple[str, int]
) -> None:
    """The one that is asked answers; the other's socket may be open at the same time."""

    async def program() -> None:
        with closing(socket.socket(family, socket.SOCK_DGRAM)) as asker:
            try:
                asker.bind((host, 0))
            except OSError:
                pytest.skip("this computer has no such address")
            asker.setblocking(False)
            port = _free(family, host)
            ends = [await answer_discovery([place], port), await answer_discovery([place], port)]
            loop = asyncio.get_running_loop()
            await loop.sock_sendto(asker, DISCOVERY_REQUEST, (host, port))
            async with asyncio.timeout(60.0):
                assert json.loads(await loop.sock_recv(asker, 100)) == {"AlpacaPort": 11111}
            for end in ends:
                end()
            await asyncio.sleep(0)

    asyncio.run(program())


def _free(family: socket.AddressFamily, host: str) -> int:
    with closing(socket.socket(family, socket.SOCK_DGRAM)) as tried:
        tried.bind((host, 0))
        return int(tried.getsockname()[1])


async def test_alpaca_discovery_offers_only_ports_that_speak_alpaca(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[tuple[str, int]]] = []
    ended: list[bool] = []

    async def answering(places: list[tuple[str, int]]) -> object:
        asked.append(places)
        return lambda: ended.append(True)

    monkeypatch.setattr(discovery, "answer_discovery", answering)
    own = DiscoveryAnswers(lambda text: None)
    await own.answer_discovery([Offer("lx200", "tcp", "0.0.0.0", 4030)])
    assert asked == [], "nothing that would be looked for so"
    await own.answer_discovery([Offer("lx200", "tcp", "0.0.0.0", 4030), Offer("alpaca", "tcp", *EVERYWHERE)])
    assert asked == [[EVERYWHERE]]
    own.close()
    assert ended == [True]


async def test_discovery_port_in_use_is_reported_and_nothing_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    async def failing(places: object) -> object:
        raise OSError(98, "UDP port 32227: Address already in use")

    monkeypatch.setattr(discovery, "answer_discovery", failing)
    said: list[str] = []
    own = DiscoveryAnswers(said.append)
    await own.answer_discovery([Offer("alpaca", "tcp", *EVERYWHERE)])
    own.close()
    assert len(said) == 1 and "UDP port 32227: Address already in use" in said[0]


async def test_skysafari_discovery_offers_no_alpaca_port() -> None:
    own = DiscoveryAnswers(lambda text: None)
    await own.answer_skyfi([Offer("alpaca", "tcp", *EVERYWHERE)], port=0)
    assert own.skyfi_port == 0
    own.close()
