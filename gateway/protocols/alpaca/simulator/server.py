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
    CONNECTING,
    NO_ACTION,
    NOT_CONNECTED,
    NOT_IMPLEMENTED,
    NOT_SET,
    PARKED,
    AlpacaError,
    AlpacaTelescope,
    ranged,
    rows,
)
from gateway.protocols.mechanics.axis_motor import LUNAR_RATE, SOLAR_RATE
from gateway.protocols.mechanics.simulated import Later

#: The longest request in bytes, and the most digits of its Content-Length.
LONGEST, LONGEST_NUMBER = 65536, 10
DEVICE = "/api/v1/telescope/0/"
#: Kind of parameter -> function that parses its text.
KINDS: dict[str, Callable[[str], Any]] = {
    "text": str, "whole": int, "number": float, "truth": lambda text: {"true": True, "false": False}[text.lower()]
}  # fmt: skip
FORM = "application/x-www-form-urlencoded"


class NotUnderstood(Exception):
    """The request is invalid: it is answered with HTTP status 400."""


class RequestFramer:
    """Cuts the bytes of a connection into HTTP requests, or into lines."""

    def __init__(self) -> None:
        self._partial_request = b""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the requests that these bytes complete, in order."""
        self._partial_request = (self._partial_request + data).lstrip(
            b"\r\n"
        )  # a gateway that begins anew ends what may have been begun
        frames = []
        while end := self._end():
            frames.append(self._partial_request[:end])
            self._partial_request = self._partial_request[end:]
        self._partial_request = self._partial_request[-LONGEST:]
        return frames

    def _end(self) -> int:
        """Return the length of the first request in bytes; 0 if it is incomplete."""
        if self._partial_request.startswith((b"get ", b"put ")):
            return self._partial_request.find(b"\n") + 1
        head = self._partial_request.find(b"\r\n\r\n") + 4
        if head < 4:
            return 0
        length = _headers(self._partial_request[:head]).get("content-length", "0")
        whole = head + (int(length) if length.isdecimal() and len(length) < LONGEST_NUMBER else 0)
        return whole if whole <= len(self._partial_request) else 0


def _headers(head: bytes) -> dict[str, str]:
    rows = (row.partition(":") for row in head.decode("latin-1").split("\r\n")[1:])
    return {name.strip().lower(): value.strip() for name, _, value in rows}


class SimulatedAlpaca(AlpacaTelescope):
    """A simulated telescope with its server."""

    def framer(self) -> RequestFramer:
        return RequestFramer()

    def answer(self, frame: bytes, send_later: Later | None) -> bytes:
        if frame.startswith((b"get ", b"put ")):
            asked = self._lines.request(frame)
            query = urlencode(asked.fields)
            status, text = self.request(asked.method, f"{asked.path}?{query}", query.encode())
            reply = self._lines.reply(status, text.encode())
        else:
            head, _, body = frame.partition(b"\r\n\r\n")
            method, target, *_ = [*head.decode("latin-1").split("\r\n")[0].split(), "", ""]
            status, text = self.request(method, target, body, _headers(head).get("content-type", FORM))
            data, kind = text.encode(), "application/json" if status == 200 else "text/plain"
            rows_of_head = (
                f"HTTP/1.1 {status} {'OK' if status == 200 else 'Bad Request'}",
                f"Content-Type: {kind}; charset=utf-8", f"Content-Length: {len(data)}\r\n\r\n",
            )  # fmt: skip
            reply = "\r\n".join(rows_of_head).encode() + data
        seconds = self.mechanics.arrives(self.now) - self.now if self.waits and send_later is not None else 0.0
        if seconds > 0.0 and send_later is not None:
            send_later(seconds, reply)
            return b""
        return reply

    waits = False
    _lines = TelescopeHttp("")
    _numbers = count(1)

    def request(self, method: str, target: str, body: bytes = b"", kind: str = FORM) -> tuple[int, str]:
        """Carry out a request and return the status and the text of the response."""
        self.advance_to_now()
        self.waits = False
        url = urlsplit(target)
        try:
            if method == "PUT" and kind.partition(";")[0] != FORM:
                raise NotUnderstood(f"A PUT has its parameters in its body as {FORM}")
            given = dict(parse_qsl(body.decode() if method == "PUT" else url.query, keep_blank_values=True))
            folded = {name.lower(): value for name, value in given.items()}
            number = folded.get("clienttransactionid", "0")
            numbers = {"ClientTransactionID": _value("ClientTransactionID", number, "whole"),
                       "ServerTransactionID": next(self._numbers)}  # fmt: skip
            try:
                answer = self.respond(method, url.path, given)
                value = {} if method == "PUT" else {"Value": answer}
                return 200, json.dumps({**value, **numbers, "ErrorNumber": 0, "ErrorMessage": ""})
            except AlpacaError as refusal:
                return 200, json.dumps({**numbers, "ErrorNumber": refusal.number, "ErrorMessage": str(refusal)})
        except (NotUnderstood, UnicodeError) as error:
            return 400, str(error)

    def respond(self, method: str, path: str, parameters: dict[str, str]) -> Any:
        """Return the value of a GET; None for a PUT. Raises NotUnderstood, AlpacaError."""
        if path.startswith("/management/") and method == "GET":
            return self._management(path)
        member, known, which = path.removeprefix(DEVICE), rows(), rows()["which"]
        wants = known["put"].get(member) if method == "PUT" else known["get"].get(member, {})
        exists = wants is not None if method == "PUT" else method == "GET" and readable(member)
        if member == path or wants is None or not exists or (member in which["platform7"] and self.platform < 7):
            raise NotUnderstood(f"There is no {method} {path}")
        if method == "GET":
            parameters = {name.lower(): value for name, value in parameters.items()}
            wants = {name.lower(): kind for name, kind in wants.items()}
        if missing := wants.keys() - parameters:
            raise NotUnderstood(f"{member}: {missing.pop()} is missing")
        values = [_value(name, parameters[name], kind) for name, kind in wants.items()]
        if self.lacks & {member, f"{member}_{method.lower()}"}:
            raise AlpacaError(NOT_IMPLEMENTED, f"{member} is not implemented in this driver.")
        if member not in which["always"] and not self.connected:
            raise AlpacaError(NOT_CONNECTED, f"{member}: the telescope is not connected")
        if method == "GET":
            return read(self, member, *values)
        if self.at == "park" and (member in which["unparked"] or (member, values) == ("tracking", [True])):
            raise AlpacaError(PARKED, f"{member} is not possible while the telescope is parked")
        WRITES[member](self, *values)
        self.waits = member in which["blocking"] or (self.blocks and member.startswith(("slew", "park", "findhome")))
        return None

    def _management(self, path: str) -> Any:
        server = {"ServerName": "Simulated server", "Manufacturer": "mount-gateway", "ManufacturerVersion": "1.0",
                  "Location": "nowhere"}  # fmt: skip
        device = {"DeviceName": f"Simulated {self.model}", "DeviceType": "Telescope", "DeviceNumber": 0,
                  "UniqueID": self.unique_id}  # fmt: skip
        values = {"apiversions": [1], "v1/description": server, "v1/configureddevices": [device]}
        try:
            return values[path.removeprefix("/management/")]
        except KeyError:
            raise NotUnderstood(f"There is no {path}") from None


def _value(name: str, text: str, kind: str) -> Any:
    """Parse a parameter of this kind. Raises NotUnderstood."""
    try:
        value = KINDS[kind](text)
        if kind != "number" or math.isfinite(value):
            return value
    except (KeyError, ValueError):
        pass
    raise NotUnderstood(f"{name} cannot be {text!r}")


# --- the members: what each returns or does; names are ASCOM's, in lower case ---------------------------------------

#: The rates of tracking: sidereal, lunar, solar.
DRIVES = (SIDEREAL_RATE, LUNAR_RATE, SOLAR_RATE)


def read(sim: AlpacaTelescope, name: str, *values: Any) -> Any:
    """Return the value of a member: the value forced by a test, else its real value. Raises AlpacaError."""
    if name in sim.tells:
        return sim.tells[name]
    if name in rows()["able"]:
        return not sim.lacks & {rows()["able"][name], rows()["able"][name].removesuffix("_put")}
    return rows()["values"][name] if name in rows()["values"] else READS[name](sim, *values)


def readable(name: str) -> bool:
    return name in READS or name in rows()["able"] or name in rows()["values"]


def _when(unix: float) -> str:
    return datetime.fromtimestamp(unix, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _target(sim: AlpacaTelescope, ra: float | None = None, dec: float | None = None) -> tuple[float, float]:
    """Return the target (RA, dec) in degrees, after setting it if RA in hours and dec are given. Raises AlpacaError."""
    if ra is not None and dec is not None:
        sim.target = [ranged(ra, 0.0, 24.0, "RightAscension") * 15.0, ranged(dec, -90.0, 90.0, "Declination")]
    return _set(sim.target[0]), _set(sim.target[1])


def _set(value: float | None) -> float:
    if value is None:
        raise AlpacaError(NOT_SET, "The target has not been set")
    return value


def _side(sim: AlpacaTelescope, flipped: bool) -> int:
    """Return SideOfPier: 0 if the tube is east of the pier and points west, 1 if it is west, -1 without a pier."""
    return int(flipped == (sim.sky.latitude >= 0.0)) if sim.model == "german" else -1


def _destination(sim: AlpacaTelescope, hours: float, dec: float) -> int:
    ra, _ = sim.of_date(hours * 15.0, dec)
    return _side(sim, sim.mechanics.geometry.other_side(wrap180(sim.sky.sidereal(sim.now) - ra)))


def _state(sim: AlpacaTelescope) -> list[dict[str, Any]]:
    names = [name for name in rows()["which"]["state"] if name.lower() not in sim.lacks]
    values = {name: read(sim, name.lower()) for name in names} | {"TimeStamp": _when(sim.now)}
    return [{"Name": name, "Value": value} for name, value in values.items()]


def _axis_rates(sim: AlpacaTelescope, axis: int) -> list[dict[str, float]]:
    rates = () if ranged(axis, 0, 2, "Axis") == 2 else sim.kind.rates
    return [{"Minimum": low, "Maximum": high} for low, high in rates]


READS: dict[str, Callable[..., Any]] = {
    "alignmentmode": lambda sim: sim.kind.mode, "altitude": lambda sim: sim.horizon()[1],
    "athome": lambda sim: sim.at == "home", "atpark": lambda sim: sim.at == "park", "axisrates": _axis_rates,
    "azimuth": lambda sim: sim.horizon()[0],
    "canmoveaxis": lambda sim, axis: ranged(axis, 0, 2, "Axis") < 2 and "moveaxis" not in sim.lacks,
    "connected": lambda sim: sim.connected, "connecting": lambda sim: sim.now < sim.connected_since < float("inf"),
    "declination": lambda sim: sim.place()[1], "description": lambda sim: f"a simulated {sim.model} mount",
    "destinationsideofpier": _destination, "devicestate": _state,
    "equatorialsystem": lambda sim: 2 if sim.sends_j2000 else 1, "guideratedeclination": lambda sim: sim.guides[1],
    "guideraterightascension": lambda sim: sim.guides[0], "interfaceversion": lambda sim: sim.platform - 3,
    "ispulseguiding": lambda sim: sim.pulses, "name": lambda sim: "Simulated mount",
    "rightascension": lambda sim: sim.place()[0] / 15.0,
    "sideofpier": lambda sim: _side(sim, sim.mechanics.flipped),
    "siderealtime": lambda sim: wrap360(sim.sky.sidereal(sim.now)) / 15.0, "siteelevation": lambda sim: sim.elevation,
    "sitelatitude": lambda sim: sim.sky.latitude, "sitelongitude": lambda sim: wrap180(sim.sky.longitude),
    "slewing": lambda sim: sim.moves, "targetdeclination": lambda sim: _set(sim.target[1]),
    "targetrightascension": lambda sim: _set(sim.target[0]) / 15.0, "tracking": lambda sim: sim.tracks,
    "trackingrate": lambda sim: sim.drive_rate, "utcdate": lambda sim: _when(sim.utc()),
}  # fmt: skip


def _action(sim: AlpacaTelescope, *_: str) -> None:
    raise AlpacaError(NO_ACTION, "There are no actions")


def _connect(sim: AlpacaTelescope, on: bool, seconds: float = 0.0) -> None:
    sim.connected_since = min(sim.connected_since, sim.now + seconds) if on else float("inf")


def _pulse(sim: AlpacaTelescope, direction: int, milliseconds: int) -> None:
    sim.pulse(int(ranged(direction, 0, 3, "Direction")), ranged(milliseconds, 0, 10_000, "Duration") / 1000.0)


def _slew(sim: AlpacaTelescope, *place: float) -> None:
    sim.slew(*_target(sim, *place))


def _sync(sim: AlpacaTelescope, *place: float) -> None:
    sim.mechanics.sync(sim.now, *sim.of_date(*_target(sim, *place)))


def _track_rate(sim: AlpacaTelescope, rate: int) -> None:
    sim.drive_rate = int(ranged(rate, 0, 2, "TrackingRate"))
    sim.mechanics.set_drive_rate(sim.now, DRIVES[rate])


def _put(name: str, low: float, high: float, unit: float = 1.0, axis: int | None = None) -> Callable[..., None]:
    """Return a function that checks a value, multiplies it by ``unit``, and stores it in the attribute ``name``, or in
    item ``axis`` of that list.
    """

    def put(sim: AlpacaTelescope, value: float) -> None:
        value = ranged(value, low, high, name) * unit
        if axis is None:
            setattr(sim, name, value)
        else:
            getattr(sim, name)[axis] = value

    return put


def _locate(field: str, maximum: float) -> Callable[..., None]:
    return lambda sim, degrees: sim.mechanics.relocate(
        sim.now, sim.sky._replace(**{field: ranged(degrees, -maximum, maximum, field)})
    )


WRITES: dict[str, Callable[..., None]] = {
    "abortslew": AlpacaTelescope.abort, "action": _action, "connect": lambda sim: _connect(sim, True, CONNECTING),
    "connected": _connect, "disconnect": lambda sim: _connect(sim, False),
    "findhome": lambda sim: sim.go(sim.start, "home"),
    "guideratedeclination": _put("guides", 0.0, SIDEREAL_RATE, axis=1),
    "guideraterightascension": _put("guides", 0.0, SIDEREAL_RATE, axis=0), "moveaxis": AlpacaTelescope.move_at_rate,
    "park": AlpacaTelescope.park, "pulseguide": _pulse,
    "setpark": lambda sim: setattr(sim, "park_at", sim.mechanics.axes(sim.now)),
    "siteelevation": _put("elevation", -300.0, 10_000.0), "sitelatitude": _locate("latitude", 90.0),
    "sitelongitude": _locate("longitude", 180.0), "synctocoordinates": _sync, "synctotarget": _sync,
    "targetdeclination": _put("target", -90.0, 90.0, axis=1),
    "targetrightascension": _put("target", 0.0, 24.0, 15.0, axis=0), "tracking": AlpacaTelescope.track,
    "trackingrate": _track_rate, "unpark": lambda sim: setattr(sim, "at", ""),
    "utcdate": AlpacaTelescope.set_clock,
    **dict.fromkeys(("slewtoaltaz", "slewtoaltazasync"), AlpacaTelescope.slew_altaz),
    **dict.fromkeys(("slewtocoordinates", "slewtocoordinatesasync", "slewtotarget", "slewtotargetasync"), _slew),
}  # fmt: skip
