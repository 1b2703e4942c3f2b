"""The server of a simulated Alpaca telescope: HTTP requests in, JSON out, as ASCOM defines them.

Invalid requests get HTTP status 400 and a text: an unknown path, a capital letter in it, a missing or misspelt
parameter, an invalid number. Everything else is answered with status 200, and errors with ASCOM's number in the JSON.
In rehearsals there is no HTTP: the driver's code converts request lines to calls of this server. The parameters and
conditions of the members are in ``mappings/alpaca/simulator.toml``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from datetime import UTC, datetime
from itertools import count
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.protocols.alpaca.driver.telescope_http import TelescopeHttp
from gateway.protocols.alpaca.simulator.telescope import (
    CONNECT_DURATION,
    NO_ACTION,
    NOT_CONNECTED,
    NOT_IMPLEMENTED,
    NOT_SET,
    PARKED,
    AlpacaError,
    AlpacaTelescope,
    check_range,
    members,
)
from gateway.protocols.mechanics.axis_motor import LUNAR_RATE, SOLAR_RATE
from gateway.protocols.mechanics.simulated import SendLater

#: The longest request in bytes, and the most digits of its Content-Length.
MAX_REQUEST_BYTES, MAX_LENGTH_DIGITS = 65536, 10
DEVICE_PATH = "/api/v1/telescope/0/"
#: Kind of parameter -> function that parses its text.
PARSER_BY_KIND: dict[str, Callable[[str], Any]] = {
    "text": str, "whole": int, "number": float, "truth": lambda text: {"true": True, "false": False}[text.lower()]
}  # fmt: skip
FORM = "application/x-www-form-urlencoded"


class InvalidRequest(Exception):
    """The request is invalid: it is answered with HTTP status 400."""


class RequestFramer:
    """Cuts the bytes of a connection into HTTP requests, or into lines."""

    def __init__(self) -> None:
        self._partial_request = b""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the requests that these bytes complete, in order."""
        self._partial_request = (self._partial_request + data).lstrip(
            b"\r\n"
        )  # a gateway that starts again first ends a partly sent request
        frames = []
        while end := self._request_length():
            frames.append(self._partial_request[:end])
            self._partial_request = self._partial_request[end:]
        self._partial_request = self._partial_request[-MAX_REQUEST_BYTES:]
        return frames

    def _request_length(self) -> int:
        """Return the length of the first request in bytes; 0 if it is incomplete."""
        if self._partial_request.startswith((b"get ", b"put ")):
            return self._partial_request.find(b"\n") + 1
        head = self._partial_request.find(b"\r\n\r\n") + 4
        if head < 4:
            return 0
        length = _parse_headers(self._partial_request[:head]).get("content-length", "0")
        whole = head + (int(length) if length.isdecimal() and len(length) < MAX_LENGTH_DIGITS else 0)
        return whole if whole <= len(self._partial_request) else 0


def _parse_headers(head: bytes) -> dict[str, str]:
    rows = (row.partition(":") for row in head.decode("latin-1").split("\r\n")[1:])
    return {name.strip().lower(): value.strip() for name, _, value in rows}


class SimulatedAlpaca(AlpacaTelescope):
    """A simulated telescope with its server."""

    def new_framer(self) -> RequestFramer:
        return RequestFramer()

    def answer(self, frame: bytes, send_later: SendLater | None) -> bytes:
        if frame.startswith((b"get ", b"put ")):
            asked = self._line_converter.request(frame)
            query = urlencode(asked.params)
            status, text = self.request(asked.method, f"{asked.path}?{query}", query.encode())
            reply = self._line_converter.reply(status, text.encode())
        else:
            head, _, body = frame.partition(b"\r\n\r\n")
            method, target, *_ = [*head.decode("latin-1").split("\r\n")[0].split(), "", ""]
            status, text = self.request(method, target, body, _parse_headers(head).get("content-type", FORM))
            data, kind = text.encode(), "application/json" if status == 200 else "text/plain"
            rows_of_head = (
                f"HTTP/1.1 {status} {'OK' if status == 200 else 'Bad Request'}",
                f"Content-Type: {kind}; charset=utf-8", f"Content-Length: {len(data)}\r\n\r\n",
            )  # fmt: skip
            reply = "\r\n".join(rows_of_head).encode() + data
        seconds = self.mechanics.arrival_time(self.now) - self.now if self.delayed and send_later is not None else 0.0
        if seconds > 0.0 and send_later is not None:
            send_later(seconds, reply)
            return b""
        return reply

    delayed = False
    _line_converter = TelescopeHttp("")
    _transaction_ids = count(1)

    def request(self, method: str, target: str, body: bytes = b"", content_type: str = FORM) -> tuple[int, str]:
        """Carry out a request and return the status and the text of the response."""
        self.advance_to_now()
        self.delayed = False
        url = urlsplit(target)
        try:
            if method == "PUT" and content_type.partition(";")[0] != FORM:
                raise InvalidRequest(f"A PUT has its parameters in its body as {FORM}")
            given = dict(parse_qsl(body.decode() if method == "PUT" else url.query, keep_blank_values=True))
            folded = {name.lower(): value for name, value in given.items()}
            number = folded.get("clienttransactionid", "0")
            numbers = {"ClientTransactionID": _parse_parameter("ClientTransactionID", number, "whole"),
                       "ServerTransactionID": next(self._transaction_ids)}  # fmt: skip
            try:
                answer = self.respond(method, url.path, given)
                value = {} if method == "PUT" else {"Value": answer}
                return 200, json.dumps({**value, **numbers, "ErrorNumber": 0, "ErrorMessage": ""})
            except AlpacaError as refusal:
                return 200, json.dumps({**numbers, "ErrorNumber": refusal.number, "ErrorMessage": str(refusal)})
        except (InvalidRequest, UnicodeError) as error:
            return 400, str(error)

    def respond(self, method: str, path: str, parameters: dict[str, str]) -> Any:
        """Return the value of a GET; None for a PUT. Raises InvalidRequest, or AlpacaError for a refused request."""
        if path.startswith("/management/") and method == "GET":
            return self._management_value(path)
        member, known, which = path.removeprefix(DEVICE_PATH), members(), members()["which"]
        wants = known["put"].get(member) if method == "PUT" else known["get"].get(member, {})
        exists = wants is not None if method == "PUT" else method == "GET" and is_readable(member)
        if member == path or wants is None or not exists or (member in which["platform7"] and self.platform < 7):
            raise InvalidRequest(f"There is no {method} {path}")
        if method == "GET":
            parameters = {name.lower(): value for name, value in parameters.items()}
            wants = {name.lower(): kind for name, kind in wants.items()}
        if missing := wants.keys() - parameters:
            raise InvalidRequest(f"{member}: {missing.pop()} is missing")
        values = [_parse_parameter(name, parameters[name], kind) for name, kind in wants.items()]
        if self.lacks & {member, f"{member}_{method.lower()}"}:
            raise AlpacaError(NOT_IMPLEMENTED, f"{member} is not implemented in this driver.")
        if member not in which["always"] and not self.connected:
            raise AlpacaError(NOT_CONNECTED, f"{member}: the telescope is not connected")
        if method == "GET":
            return read_member(self, member, *values)
        if self.at == "park" and (member in which["unparked"] or (member, values) == ("tracking", [True])):
            raise AlpacaError(PARKED, f"{member} is not possible while the telescope is parked")
        WRITER_BY_MEMBER[member](self, *values)
        self.delayed = member in which["blocking"] or (self.blocks and member.startswith(("slew", "park", "findhome")))
        return None

    def _management_value(self, path: str) -> Any:
        server = {"ServerName": "Simulated server", "Manufacturer": "mount-gateway", "ManufacturerVersion": "1.0",
                  "Location": "nowhere"}  # fmt: skip
        device = {"DeviceName": f"Simulated {self.model}", "DeviceType": "Telescope", "DeviceNumber": 0,
                  "UniqueID": self.unique_id}  # fmt: skip
        values = {"apiversions": [1], "v1/description": server, "v1/configureddevices": [device]}
        try:
            return values[path.removeprefix("/management/")]
        except KeyError:
            raise InvalidRequest(f"There is no {path}") from None


def _parse_parameter(name: str, text: str, kind: str) -> Any:
    """Parse the text of a parameter; ``kind`` is a key of ``PARSER_BY_KIND``. Raises InvalidRequest."""
    try:
        value = PARSER_BY_KIND[kind](text)
        if kind != "number" or math.isfinite(value):
            return value
    except (KeyError, ValueError):
        pass
    raise InvalidRequest(f"{name} cannot be {text!r}")


# --- the members: what each returns or does; names are ASCOM's, in lower case ---------------------------------------

#: The rates of tracking, degrees a second: sidereal, lunar, solar.
DRIVE_RATES = (SIDEREAL_RATE, LUNAR_RATE, SOLAR_RATE)


def read_member(sim: AlpacaTelescope, member: str, *values: Any) -> Any:
    """Return the value of a member: the value forced by a test, else its real value. Raises AlpacaError."""
    if member in sim.answers:
        return sim.answers[member]
    if member in members()["able"]:
        return not sim.lacks & {members()["able"][member], members()["able"][member].removesuffix("_put")}
    return members()["values"][member] if member in members()["values"] else READER_BY_MEMBER[member](sim, *values)


def is_readable(member: str) -> bool:
    return member in READER_BY_MEMBER or member in members()["able"] or member in members()["values"]


def _iso_time(unix: float) -> str:
    return datetime.fromtimestamp(unix, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _resolved_target(sim: AlpacaTelescope, ra: float | None = None, dec: float | None = None) -> tuple[float, float]:
    """Return the target (RA, dec), degrees. If RA (hours) and dec are given, set it first. Raises AlpacaError if these
    are out of range, or if no target is set.
    """
    if ra is not None and dec is not None:
        sim.target = [check_range(ra, 0.0, 24.0, "RightAscension") * 15.0, check_range(dec, -90.0, 90.0, "Declination")]
    return _require_set(sim.target[0]), _require_set(sim.target[1])


def _require_set(value: float | None) -> float:
    if value is None:
        raise AlpacaError(NOT_SET, "The target has not been set")
    return value


def _pier_side(sim: AlpacaTelescope, flipped: bool) -> int:
    """Return SideOfPier: 0 if the tube is east of the pier and points west, 1 if it is west, -1 without a pier."""
    return int(flipped == (sim.sky.latitude >= 0.0)) if sim.model == "german" else -1


def _destination_side(sim: AlpacaTelescope, ra_hours: float, dec: float) -> int:
    ra, _ = sim.to_jnow(ra_hours * 15.0, dec)
    return _pier_side(sim, sim.mechanics.geometry.is_flipped(wrap180(sim.sky.lst(sim.now) - ra)))


def _device_state(sim: AlpacaTelescope) -> list[dict[str, Any]]:
    names = [name for name in members()["which"]["state"] if name.lower() not in sim.lacks]
    values = {name: read_member(sim, name.lower()) for name in names} | {"TimeStamp": _iso_time(sim.now)}
    return [{"Name": name, "Value": value} for name, value in values.items()]


def _axis_rates(sim: AlpacaTelescope, axis: int) -> list[dict[str, float]]:
    rates = () if check_range(axis, 0, 2, "Axis") == 2 else sim.kind.rate_ranges
    return [{"Minimum": low, "Maximum": high} for low, high in rates]


READER_BY_MEMBER: dict[str, Callable[..., Any]] = {
    "alignmentmode": lambda sim: sim.kind.alignment_mode, "altitude": lambda sim: sim.azimuth_altitude()[1],
    "athome": lambda sim: sim.at == "home", "atpark": lambda sim: sim.at == "park", "axisrates": _axis_rates,
    "azimuth": lambda sim: sim.azimuth_altitude()[0],
    "canmoveaxis": lambda sim, axis: check_range(axis, 0, 2, "Axis") < 2 and "moveaxis" not in sim.lacks,
    "connected": lambda sim: sim.connected, "connecting": lambda sim: sim.now < sim.connected_since < float("inf"),
    "declination": lambda sim: sim.reported_position()[1], "description": lambda sim: f"a simulated {sim.model} mount",
    "destinationsideofpier": _destination_side, "devicestate": _device_state,
    "equatorialsystem": lambda sim: 2 if sim.sends_j2000 else 1, "guideratedeclination": lambda sim: sim.guides[1],
    "guideraterightascension": lambda sim: sim.guides[0], "interfaceversion": lambda sim: sim.platform - 3,
    "ispulseguiding": lambda sim: sim.is_pulsing, "name": lambda sim: "Simulated mount",
    "rightascension": lambda sim: sim.reported_position()[0] / 15.0,
    "sideofpier": lambda sim: _pier_side(sim, sim.mechanics.flipped),
    "siderealtime": lambda sim: wrap360(sim.sky.lst(sim.now)) / 15.0, "siteelevation": lambda sim: sim.elevation,
    "sitelatitude": lambda sim: sim.sky.latitude, "sitelongitude": lambda sim: wrap180(sim.sky.longitude),
    "slewing": lambda sim: sim.reports_slewing, "targetdeclination": lambda sim: _require_set(sim.target[1]),
    "targetrightascension": lambda sim: _require_set(sim.target[0]) / 15.0, "tracking": lambda sim: sim.tracks,
    "trackingrate": lambda sim: sim.drive_rate, "utcdate": lambda sim: _iso_time(sim.utc()),
}  # fmt: skip


def _refuse_action(sim: AlpacaTelescope, *_: str) -> None:
    raise AlpacaError(NO_ACTION, "There are no actions")


def _connect(sim: AlpacaTelescope, on: bool, seconds: float = 0.0) -> None:
    sim.connected_since = min(sim.connected_since, sim.now + seconds) if on else float("inf")


def _pulse(sim: AlpacaTelescope, direction: int, milliseconds: int) -> None:
    sim.pulse(int(check_range(direction, 0, 3, "Direction")), check_range(milliseconds, 0, 10_000, "Duration") / 1000.0)


def _slew(sim: AlpacaTelescope, *coordinates: float) -> None:
    sim.slew(*_resolved_target(sim, *coordinates))


def _sync(sim: AlpacaTelescope, *coordinates: float) -> None:
    sim.mechanics.sync(sim.now, *sim.to_jnow(*_resolved_target(sim, *coordinates)))


def _set_drive_rate(sim: AlpacaTelescope, rate: int) -> None:
    sim.drive_rate = int(check_range(rate, 0, 2, "TrackingRate"))
    sim.mechanics.set_drive_rate(sim.now, DRIVE_RATES[rate])


def _setter(name: str, low: float, high: float, unit: float = 1.0, axis: int | None = None) -> Callable[..., None]:
    """Return a function that checks a value and stores it times ``unit`` in attribute ``name`` or its item ``axis``."""

    def put(sim: AlpacaTelescope, value: float) -> None:
        value = check_range(value, low, high, name) * unit
        if axis is None:
            setattr(sim, name, value)
        else:
            getattr(sim, name)[axis] = value

    return put


def _site_setter(field: str, maximum: float) -> Callable[..., None]:
    return lambda sim, degrees: sim.mechanics.relocate(
        sim.now, sim.sky._replace(**{field: check_range(degrees, -maximum, maximum, field)})
    )


WRITER_BY_MEMBER: dict[str, Callable[..., None]] = {
    "abortslew": AlpacaTelescope.abort, "action": _refuse_action,
    "connect": lambda sim: _connect(sim, True, CONNECT_DURATION), "connected": _connect,
    "disconnect": lambda sim: _connect(sim, False), "findhome": lambda sim: sim.slew_to_axes(sim.power_on_axes, "home"),
    "guideratedeclination": _setter("guides", 0.0, SIDEREAL_RATE, axis=1),
    "guideraterightascension": _setter("guides", 0.0, SIDEREAL_RATE, axis=0), "moveaxis": AlpacaTelescope.move_at_rate,
    "park": AlpacaTelescope.park, "pulseguide": _pulse,
    "setpark": lambda sim: setattr(sim, "park_at", sim.mechanics.axes(sim.now)),
    "siteelevation": _setter("elevation", -300.0, 10_000.0), "sitelatitude": _site_setter("latitude", 90.0),
    "sitelongitude": _site_setter("longitude", 180.0), "synctocoordinates": _sync, "synctotarget": _sync,
    "targetdeclination": _setter("target", -90.0, 90.0, axis=1),
    "targetrightascension": _setter("target", 0.0, 24.0, 15.0, axis=0), "tracking": AlpacaTelescope.track,
    "trackingrate": _set_drive_rate, "unpark": lambda sim: setattr(sim, "at", ""), "utcdate": AlpacaTelescope.set_clock,
    **dict.fromkeys(("slewtoaltaz", "slewtoaltazasync"), AlpacaTelescope.slew_altaz),
    **dict.fromkeys(("slewtocoordinates", "slewtocoordinatesasync", "slewtotarget", "slewtotargetasync"), _slew),
}  # fmt: skip
