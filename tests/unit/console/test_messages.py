"""What a page sends becomes one of the requests that everybody has, in its own name and under a number of its own."""

from __future__ import annotations

import asyncio
import json
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.console import messages
from gateway.console.page_session import PageSession
from gateway.core import requests
from tests.support.each import each

ME = "the console at 10.0.0.9"
MINE = {"number": "n", "who": ME}


def read(do: str, **fields: Any) -> Any:
    return messages.decode(json.dumps({"do": do, **fields}), ME).request


@each(
    ("sent", "wish"),
    [
        ({"do": "goto", "name": "M42"}, requests.GotoRequest(requests.Named("M42"), **MINE)),
        ({"do": "goto", "ra": 83, "dec": 22.0}, requests.GotoRequest(requests.Spot(83.0, 22.0), **MINE)),
        ({"do": "sync", "ra": 1, "dec": 2, "j2000": True}, requests.SyncRequest(requests.Spot(1.0, 2.0, True), **MINE)),
        ({"do": "wake"}, requests.UnparkRequest(**MINE)),
        ({"do": "track", "on": False}, requests.TrackRequest(on=False, **MINE)),
        ({"do": "site", "latitude": 48, "longitude": 11}, requests.SetSiteRequest(48.0, 11.0, **MINE)),
        ({"do": "stop"}, requests.StopRequest(ME)),
        ({"do": "let_go", "direction": "north", "press": 3}, messages.ReleaseArrow("north", 3)),
    ],
)
def test_page_message_is_parsed_into_the_matching_request(
    sent: dict[str, Any], wish: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "new_request_number", lambda: "n")
    assert messages.decode(json.dumps({"id": 7, "mount": 2, **sent}), ME) == (7, 2, wish)


def test_stop_of_all_mounts_is_confirmed_when_all_have_stopped() -> None:
    def gateway(answer: requests.Answer) -> Any:
        async def take(wish: object) -> requests.Answer:
            return answer if wish == requests.StopRequest(ME) else requests.Answer("failed", str(wish))

        return SimpleNamespace(controller=None, carry_out=take)

    class Browser:
        def unread_byte_count(self) -> int:
            return 0

        async def send(self, text: str) -> None:
            told.set_result(json.loads(text))

    async def work() -> None:
        nonlocal told
        told = asyncio.get_running_loop().create_future()
        gateways = [gateway(requests.Answer("done", "stopped")), gateway(requests.Answer("failed", "it is silent"))]
        mounts: Any = SimpleNamespace(gateways=gateways, arrows=[[], []])
        PageSession(mounts, Browser(), "10.0.0.9", may_control=False).receive('{"do":"stop","mount":-1,"id":5}')
        assert await asyncio.wait_for(told, 60.0) == {"id": 5, "ok": False, "words": "stopped; it is silent"}

    told: asyncio.Future[Any]
    asyncio.run(work())


def test_page_message_cannot_claim_another_sender() -> None:
    park = read("park", who="mqtt", number="1", type="home")
    assert isinstance(park, requests.ParkRequest) and park.who == ME and len(park.number) == 16


@each(
    "sent",
    [
        {"do": "goto"},
        {"do": "goto", "ra": 83.0},
        {"do": "site", "latitude": 91.0, "longitude": 0.0},
        {"do": "track", "rate": "king"},
        {"do": "press", "direction": "north", "key": 9},
        {"do": "end"},
        {"do": "see"},
        {"do": "park", "mount": -2},
        {},
    ],
)
def test_page_message_for_a_forbidden_operation_is_refused(sent: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"\$|required field|Invalid"):
        messages.decode(json.dumps(sent), ME)
