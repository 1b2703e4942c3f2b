"""The simulated Alpaca telescope as a server: ASCOM's members and types, its judge, and what servers do wrong."""

from __future__ import annotations

import asyncio
import json
from typing import Any
from urllib.parse import urlencode

import pytest

from gateway.core.errors import UserError
from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca
from tests.conformance.ascom.telescope import FAST, Ascom, Issue, Skipped, Telescope
from tests.conformance.ascom.test_judge import CHECKS
from tests.conformance.test_alpaca_members import READ, WRITTEN
from tests.support.in_process_gateway import EVENING

KINDS = ("german", "polar", "altaz")
NOT_IMPLEMENTED, INVALID, NOT_CONNECTED, PARKED, NOT_NOW = 0x400, 0x401, 0x407, 0x408, 0x40B
DEVICE = "/api/v1/telescope/0/"
#: What the judge says against it. It has no actions; IsPulseGuiding is false where there is no PulseGuide.
KNOWN = {"german": {"SupportedActions"}, "polar": {"SupportedActions"}, "altaz": {"SupportedActions", "IsPulseGuiding"}}


class Program:
    """A program, which asks a simulated telescope without anything in between; ``now`` is its clock."""

    def __init__(self, kind: str = "german", connected: bool = True, **made: Any) -> None:
        self.now = EVENING
        self.sim = SimulatedAlpaca(kind, clock=lambda: self.now, **made)
        if connected:
            self.put("connected", Connected=True)

    def http(self, method: str, target: str, **parameters: Any) -> tuple[int, str]:
        words = urlencode(parameters)
        if method == "GET":
            return self.sim.request(method, f"{target}?{words}")
        return self.sim.request(method, target, words.encode())

    def answer(self, method: str, member: str, **parameters: Any) -> dict[str, Any]:
        status, text = self.http(method, DEVICE + member, **parameters)
        assert status == 200, text
        found: dict[str, Any] = json.loads(text)
        return found

    def get(self, member: str, **parameters: Any) -> Any:
        return self.answer("GET", member, **parameters)["Value"]

    def put(self, member: str, **parameters: Any) -> int:
        """Return the number of the error, 0 for none."""
        number: int = self.answer("PUT", member, **parameters)["ErrorNumber"]
        return number

    def place(self) -> tuple[float, float]:
        return self.get("rightascension") * 15.0, self.get("declination")


class Judged(Telescope):
    """The judge's telescope without a gateway."""

    def __init__(self, sim: SimulatedAlpaca) -> None:
        self.sim, self.own, self.late, self.can = sim, sim, {}, {}  # type: ignore[assignment]

    async def _ask(self, method: str, member: str, parameters: dict[str, Any], target: float) -> Any:
        words = urlencode(parameters)
        where = DEVICE + member.lower() + (f"?{words}" if method == "GET" else "")
        status, text = self.sim.request(method, where, words.encode())
        while self.sim.delayed and target != FAST and self.sim.mechanics.slewing(self.sim.clock()):
            await asyncio.sleep(0.5)
        if status != 200:
            raise Issue(f"HTTP {status}: {text}")
        reply = json.loads(text)
        if reply["ErrorNumber"]:
            raise Ascom(reply["ErrorNumber"], reply["ErrorMessage"])
        return reply.get("Value")


@pytest.mark.parametrize("latitude", [45.0, -33.5])
@pytest.mark.parametrize("kind", KINDS)
async def test_simulated_alpaca_telescope_passes_ascom_conformance_checks(kind: str, latitude: float) -> None:
    loop = asyncio.get_running_loop()
    scope, found = Judged(SimulatedAlpaca(kind, clock=lambda: EVENING + loop.time(), site=(latitude, 10.0))), {}
    for name, check in CHECKS.items():
        try:
            await check(scope)
        except (Issue, Ascom) as error:
            found[name] = str(error)
        except Skipped:
            pass
    assert found.keys() == KNOWN[kind], found


def test_every_alpaca_member_has_ascoms_type_and_parameters() -> None:
    kinds = {"number": (float, int), "integer": int, "boolean": bool, "string": str, "array": list}
    program = Program()
    program.put("targetrightascension", TargetRightAscension=5.5), program.put("targetdeclination", TargetDeclination=2)
    for member, (names, kind) in READ.items():
        found = program.answer("GET", member, **dict.fromkeys(names.split(), 1))
        assert found["ErrorNumber"] == NOT_IMPLEMENTED or isinstance(found["Value"], kinds[kind]), member
        assert found.keys() >= {"ClientTransactionID", "ServerTransactionID", "ErrorMessage"}
        for name in names.split():
            lower = program.http("GET", DEVICE + member, **{one.lower(): 1 for one in names.split()})
            assert lower[0] == 200 and program.http("GET", DEVICE + member)[0] == 400, name
    for member, names in WRITTEN.items():
        for name in names.split():
            others = {one: "1" for one in names.split() if one != name}
            assert program.http("PUT", DEVICE + member, **others)[0] == 400, (member, name)
            assert program.http("PUT", DEVICE + member, **others, **{name.lower(): "1"})[0] == 400, (member, name)


def test_simulated_alpaca_server_answers_400_to_a_malformed_request() -> None:
    program = Program()
    for method, member, given in (
        ("GET", "RightAscension", {}), ("GET", "nothing", {}), ("PUT", "rightascension", {}), ("POST", "connected", {}),
        ("PUT", "moveaxis", {"Axis": 0, "Rate": "fast"}), ("PUT", "moveaxis", {"Axis": 0, "Rate": "nan"}),
        ("PUT", "tracking", {"Tracking": "maybe"}), ("GET", "axisrates", {"Axis": 1.5}),
        ("GET", "connected", {"ClientTransactionID": "x"}),
    ):  # fmt: skip
        assert program.http(method, DEVICE + member, **given)[0] == 400, (method, member, given)
    assert program.http("GET", "/api/v1/telescope/1/connected")[0] == 400
    assert program.sim.request("PUT", DEVICE + "tracking", b'{"Tracking": true}', "application/json")[0] == 400


def test_simulated_alpaca_telescope_obeys_both_connect_and_connected() -> None:
    program = Program(connected=False)
    assert program.answer("GET", "tracking")["ErrorNumber"] == NOT_CONNECTED and program.get("connected") is False
    program.put("connect")
    assert program.get("connecting") is True and program.get("connected") is False
    program.now += 1.0
    assert program.get("connecting") is False and program.get("connected") is True
    program.put("connected", Connected="False")
    assert program.get("connected") is False
    older = Program(platform=6)
    assert older.get("interfaceversion") == 3 and older.get("connected") is True
    for method, member in (("PUT", "connect"), ("GET", "connecting"), ("GET", "devicestate"), ("PUT", "disconnect")):
        assert older.http(method, DEVICE + member)[0] == 400


def test_simulated_alpaca_telescope_reports_missing_abilities_and_refuses_them() -> None:
    program = Program(
        lacks=frozenset({"synctocoordinates", "siderealtime", "tracking_put"}), answers={"slewing": False}
    )
    assert [program.get(f"can{word}") for word in ("sync", "settracking", "park")] == [False, False, True]
    assert program.put("synctocoordinates", RightAscension=5, Declination=5) == NOT_IMPLEMENTED
    assert program.put("tracking", Tracking=False) == NOT_IMPLEMENTED and program.get("tracking") is True
    state = {one["Name"]: one["Value"] for one in program.get("devicestate")}
    assert "SiderealTime" not in state and state["Slewing"] is False
    program.put("slewtocoordinatesasync", RightAscension=5.5, Declination=22)
    assert program.sim.slewing and program.get("slewing") is False


@pytest.mark.parametrize("quiet", [False, True])
def test_simulated_alpaca_telescope_reports_slewing_while_an_axis_moves(quiet: bool) -> None:
    program = Program(quiet_axes=quiet, senses=(-1, 1))
    program.put("slewtocoordinatesasync", RightAscension=5.5, Declination=22)
    program.now += 100.0
    before = program.place()[0]
    program.put("moveaxis", Axis=0, Rate=0.5)
    program.now += 2.0
    assert program.get("slewing") is not quiet and program.sim.mechanics.is_moving(program.now)
    assert 0.5 < program.place()[0] - before < 1.1  # with this sign east, where right ascension grows
    program.put("moveaxis", Axis=0, Rate=0)
    program.now += 2.0
    assert program.get("slewing") is False and program.get("tracking") is True and program.sim.tracking


def test_simulated_alpaca_telescope_uses_the_equinox_that_it_reports() -> None:
    program = Program(sends_j2000=True, answers={"equatorialsystem": 1})
    program.put("slewtocoordinatesasync", RightAscension=5.5, Declination=22)
    program.now += 100.0
    ra, dec = program.sim.true_position()
    assert program.place() == pytest.approx((82.5, 22.0), abs=1e-3)
    assert 0.2 < ra - 82.5 < 0.5 and abs(dec - 22.0) < 0.1 and program.get("equatorialsystem") == 1


def test_simulated_alpaca_server_answers_slewtocoordinates_on_arrival() -> None:
    later: list[tuple[float, bytes]] = []
    program = Program()
    feed = program.sim.connection(lambda seconds, reply: later.append((seconds, reply)))
    assert feed(b"put slewtocoordinates RightAscension=5.5 Declination=22\n") == b""
    assert feed(b"get slewing\n") == b"true\n"
    [(seconds, reply)] = later
    program.now += seconds
    assert reply == b"null\n" and feed(b"get slewing\n") == b"false\n" and 5.0 < seconds < 60.0


def test_simulated_alpaca_telescope_stores_its_clock_and_site() -> None:
    program, deaf = Program(), Program(keeps_clock=True)
    for one in (program, deaf):
        assert one.put("utcdate", UTCDate="2026-06-01T01:02:03Z") == 0 == one.put("sitelatitude", SiteLatitude=-30.5)
    assert program.get("utcdate") == "2026-06-01T01:02:03.000Z" and deaf.get("utcdate").startswith("2026-01-15T22:00")
    assert program.get("sitelatitude") == -30.5 and program.put("utcdate", UTCDate="soon") == INVALID


def test_simulated_alpaca_server_accepts_requests_in_pieces_and_several_at_once() -> None:
    """Requests may arrive in pieces, and several at once."""
    program = Program()
    feed = program.sim.connection()
    body = b"Tracking=False&ClientTransactionID=7"
    whole = b"PUT %stracking HTTP/1.1\r\nContent-Length: %d\r\n\r\n%s" % (DEVICE.encode(), len(body), body)
    assert feed(whole[:30]) == b"" == feed(whole[30:-5])
    head, _, answer = feed(whole[-5:] + b"GET /management/apiversions HTTP/1.1\r\n\r\n").partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200 OK") and b'"ClientTransactionID": 7' in answer and b'"Value": [1]' in answer
    assert not program.sim.tracking
    assert feed(b"nonsense\r\nContent-Length: -1\r\n\r\n").startswith(b"HTTP/1.1 400 ")
    assert feed(b"GET /nowhere HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 400 ")


def test_unknown_alpaca_model_is_refused() -> None:
    with pytest.raises(UserError, match="german, altaz, polar"):
        SimulatedAlpaca("fork", clock=lambda: EVENING)
