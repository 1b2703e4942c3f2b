"""The members of ASCOM's ITelescopeV4 with their types and parameters, typed from ASCOM's reference, on four mounts."""

from __future__ import annotations

import json
import re
from datetime import datetime
from typing import Any

import pytest

from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.protocols.alpaca.http.requests import signatures
from tests.support import exact_sky
from tests.support.each import each

START = 1769634000.0
NOT_IMPLEMENTED, INVALID, NOT_SET, NOT_CONNECTED = 0x400, 0x401, 0x402, 0x407
#: What a property is: a JSON type, or the error of one that no mount here has.
DOUBLE, INTEGER, BOOLEAN, STRING, LIST = "number", "integer", "boolean", "string", "array"
#: Properties and methods that are read, in the order of the reference: parameters, type.
READ: dict[str, tuple[str, str]] = {
    "connected": ("", BOOLEAN), "connecting": ("", BOOLEAN), "description": ("", STRING), "devicestate": ("", LIST),
    "driverinfo": ("", STRING), "driverversion": ("", STRING), "interfaceversion": ("", INTEGER), "name": ("", STRING),
    "supportedactions": ("", LIST),
    "alignmentmode": ("", INTEGER), "altitude": ("", DOUBLE), "aperturearea": ("", DOUBLE),
    "aperturediameter": ("", DOUBLE), "athome": ("", BOOLEAN), "atpark": ("", BOOLEAN), "azimuth": ("", DOUBLE),
    "canfindhome": ("", BOOLEAN), "canpark": ("", BOOLEAN), "canpulseguide": ("", BOOLEAN),
    "cansetdeclinationrate": ("", BOOLEAN), "cansetguiderates": ("", BOOLEAN), "cansetpark": ("", BOOLEAN),
    "cansetpierside": ("", BOOLEAN), "cansetrightascensionrate": ("", BOOLEAN), "cansettracking": ("", BOOLEAN),
    "canslew": ("", BOOLEAN), "canslewaltaz": ("", BOOLEAN), "canslewaltazasync": ("", BOOLEAN),
    "canslewasync": ("", BOOLEAN), "cansync": ("", BOOLEAN), "cansyncaltaz": ("", BOOLEAN), "canunpark": ("", BOOLEAN),
    "declination": ("", DOUBLE), "declinationrate": ("", DOUBLE), "doesrefraction": ("", BOOLEAN),
    "equatorialsystem": ("", INTEGER), "focallength": ("", DOUBLE), "guideratedeclination": ("", DOUBLE),
    "guideraterightascension": ("", DOUBLE), "ispulseguiding": ("", BOOLEAN), "rightascension": ("", DOUBLE),
    "rightascensionrate": ("", DOUBLE), "sideofpier": ("", INTEGER), "siderealtime": ("", DOUBLE),
    "siteelevation": ("", DOUBLE), "sitelatitude": ("", DOUBLE), "sitelongitude": ("", DOUBLE),
    "slewing": ("", BOOLEAN), "slewsettletime": ("", INTEGER), "targetdeclination": ("", DOUBLE),
    "targetrightascension": ("", DOUBLE), "tracking": ("", BOOLEAN), "trackingrate": ("", INTEGER),
    "trackingrates": ("", LIST), "utcdate": ("", STRING),
    "axisrates": ("Axis", LIST), "canmoveaxis": ("Axis", BOOLEAN),
    "destinationsideofpier": ("RightAscension Declination", INTEGER),
}  # fmt: skip
#: Properties that are written, and methods.
WRITTEN = {
    "action": "Action Parameters", "commandblind": "Command Raw", "commandbool": "Command Raw",
    "commandstring": "Command Raw", "connect": "", "connected": "Connected", "disconnect": "",
    "declinationrate": "DeclinationRate", "doesrefraction": "DoesRefraction",
    "guideratedeclination": "GuideRateDeclination", "guideraterightascension": "GuideRateRightAscension",
    "rightascensionrate": "RightAscensionRate", "sideofpier": "SideOfPier", "siteelevation": "SiteElevation",
    "sitelatitude": "SiteLatitude", "sitelongitude": "SiteLongitude", "slewsettletime": "SlewSettleTime",
    "targetdeclination": "TargetDeclination", "targetrightascension": "TargetRightAscension", "tracking": "Tracking",
    "trackingrate": "TrackingRate", "utcdate": "UTCDate",
    "abortslew": "", "findhome": "", "moveaxis": "Axis Rate", "park": "", "pulseguide": "Direction Duration",
    "setpark": "", "slewtoaltaz": "Azimuth Altitude", "slewtoaltazasync": "Azimuth Altitude",
    "slewtocoordinates": "RightAscension Declination", "slewtocoordinatesasync": "RightAscension Declination",
    "slewtotarget": "", "slewtotargetasync": "", "synctoaltaz": "Azimuth Altitude",
    "synctocoordinates": "RightAscension Declination", "synctotarget": "", "unpark": "",
}  # fmt: skip
#: What no mount here has, and what has not been set.
NOWHERE = {"aperturearea", "aperturediameter", "doesrefraction", "focallength", "slewsettletime"}
UNSET = {"targetdeclination", "targetrightascension"}
#: By mount: how it is built, and what it can do of what differs.
FORK, POLAR, GERMAN = 0, 1, 2
MOUNTS: dict[tuple[str, str], dict[str, Any]] = {
    ("6-8se", "nexstar"): {
        "alignmentmode": FORK, "sideofpier": -1, "canpark": True, "cansettracking": True, "canslewaltaz": True,
        "trackingrates": [0], "cansetguiderates": True, "canfindhome": False, "canpulseguide": True,
    },
    ("cge", "nexstar"): {
        "alignmentmode": GERMAN, "sideofpier": 0, "canpark": True, "cansettracking": True, "canslewaltaz": True,
        "trackingrates": [0, 1, 2], "cansetguiderates": True, "canfindhome": False, "canpulseguide": True,
    },
    ("lx200", "lx200"): {
        "alignmentmode": POLAR, "sideofpier": -1, "canpark": False, "canunpark": False, "cansettracking": False,
        "canslewaltaz": False, "trackingrates": [0, 1, 2], "cansetguiderates": False, "canfindhome": False,
        "canpulseguide": True,
    },
    ("lx200gps", "lx200"): {
        "alignmentmode": FORK, "sideofpier": -1, "canpark": True, "cansettracking": True, "canslewaltaz": True,
        "trackingrates": [0, 1, 2], "cansetguiderates": True, "canfindhome": True, "canpulseguide": True,
    },
}  # fmt: skip
TYPES: dict[str, tuple[type, ...]] = {
    DOUBLE: (float,), INTEGER: (int,), BOOLEAN: (bool,), STRING: (str,), LIST: (list,)
}  # fmt: skip


def test_alpaca_surface_has_exactly_the_members_of_the_reference() -> None:
    known = {key: " ".join(found.parameters) for key, found in signatures().items()}
    assert known == {
        **{("get", name): parameters for name, (parameters, _) in READ.items()},
        **{("put", name): parameters for name, parameters in WRITTEN.items()},
    }


async def answer(program: RehearsalClient, line: str) -> Any:
    """A value; an error as its number."""
    told = json.loads(await program.ask(line.encode() + b"\n", ending=b"\n"))
    return -told["ErrorNumber"] if isinstance(told, dict) else told


@pytest.mark.parametrize("mount", MOUNTS, ids="-".join)
async def test_every_alpaca_property_has_the_type_of_the_reference(mount: tuple[str, str]) -> None:
    async with RehearsalGateway(mount[0], start=START, driven=mount[1], presented="alpaca", named=True) as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        await answer(client, "put connected Connected=true")
        for name, (parameters, kind) in READ.items():
            given = "".join(f" {one}={'22.5' if one == 'Declination' else '1'}" for one in parameters.split())
            value = await answer(client, f"get {name}{given}")
            if name in NOWHERE | UNSET:
                assert value == -(NOT_IMPLEMENTED if name in NOWHERE else NOT_SET), name
            else:
                assert type(value) in TYPES[kind], (name, value)
        for name, value in MOUNTS[mount].items():
            assert await answer(client, f"get {name}") == value, name
        assert 0.0 <= await answer(client, "get rightascension") < 24.0
        assert await answer(client, "get interfaceversion") == 4
        assert await answer(client, "get equatorialsystem") == 1
        assert abs(await answer(client, "get sitelongitude") - 10.0) < 0.02, "east counts positive"
        utc = await answer(client, "get utcdate")
        assert re.fullmatch(r"(\d{4})-(\d{2})-(\d{2})T(\d{2}):(\d{2}):(\d{2})(?:\.(\d+))?Z", utc)
        assert abs(datetime.fromisoformat(utc).timestamp() - own.clock()) < 2.0
        rates = await answer(client, "get axisrates Axis=0")
        assert rates and all(0.0 < one["Minimum"] <= one["Maximum"] for one in rates)
        assert await answer(client, "get axisrates Axis=2") == []
        assert await answer(client, "get canmoveaxis Axis=2") is False
        assert await answer(client, "get canmoveaxis Axis=3") == -INVALID
        state = {one["Name"] for one in await answer(client, "get devicestate")}
        assert state == {
            "Altitude", "AtHome", "AtPark", "Azimuth", "Declination", "IsPulseGuiding", "RightAscension",
            "SideOfPier", "SiderealTime", "Slewing", "Tracking", "UTCDate", "TimeStamp",
        }  # fmt: skip


#: Members that a program may ask for before it has connected; a stop is never refused.
ALWAYS = {
    "connected", "connecting", "description", "driverinfo", "driverversion", "interfaceversion", "name",
    "supportedactions", "action", "commandblind", "commandbool", "commandstring", "connect", "disconnect", "abortslew",
}  # fmt: skip


async def test_disconnected_alpaca_program_neither_moves_nor_reads_the_mount() -> None:
    """A program that has never written Connected may read; one that has disconnected may not."""
    async with RehearsalGateway("6-8se", start=START, presented="alpaca", named=True) as own:
        client = own.client()
        for name, (parameters, _) in READ.items():
            given = "".join(f" {one}=1" for one in parameters.split())
            assert await answer(client, f"get {name}{given}") != -NOT_CONNECTED, name
        await answer(client, "put disconnect")
        for name, (parameters, _) in READ.items():
            given = "".join(f" {one}=1" for one in parameters.split())
            refused = await answer(client, f"get {name}{given}") == -NOT_CONNECTED
            assert refused is (name not in ALWAYS), name
        for name, parameters in WRITTEN.items():
            if name not in ALWAYS:
                given = "".join(f" {one}={_anything(one)}" for one in parameters.split())
                assert await answer(client, f"put {name}{given}") == -NOT_CONNECTED, name
        assert not own.sim.slewing


def _anything(parameter: str) -> str:
    return {"UTCDate": "2026-01-28T21:00:00Z", "Tracking": "true", "DoesRefraction": "true"}.get(parameter, "1")


@each(
    ("line", "error"),
    [
        ("put trackingrate TrackingRate=3", INVALID),
        ("put trackingrate TrackingRate=5", INVALID),
        ("put guideratedeclination GuideRateDeclination=0.01", INVALID),
        ("put moveaxis Axis=3 Rate=1.0", INVALID),
        ("put pulseguide Direction=4 Duration=10", INVALID),
        ("put pulseguide Direction=0 Duration=-1", INVALID),
        ("put slewtotargetasync", NOT_SET),
        ("put synctotarget", NOT_SET),
        ("put slewtoaltazasync Azimuth=100 Altitude=40", 0x40B),
        ("put slewtocoordinatesasync RightAscension=5.0 Declination=-80.0", 0x40B),
        ("put synctoaltaz Azimuth=100 Altitude=40", NOT_IMPLEMENTED),
        ("put setpark", NOT_IMPLEMENTED),
        ("put action Action=x Parameters=", NOT_IMPLEMENTED),
        ("put commandstring Command=x Raw=true", NOT_IMPLEMENTED),
    ],
)
async def test_alpaca_refusals_carry_the_error_number_of_the_reference(line: str, error: int) -> None:
    async with RehearsalGateway("6-8se", start=START, presented="alpaca", named=True) as own:
        client = own.client()
        await answer(client, "put connected Connected=true")
        assert await answer(client, line) == -error
        assert not own.sim.slewing
