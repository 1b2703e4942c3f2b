"""The members of a simulated Alpaca telescope: what each returns or does.

Their parameters and conditions are in ``mappings/alpaca/simulator.toml``. Names are those of ASCOM's telescope
interface, in lower case as in addresses.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from gateway.astro.spherical import SIDEREAL_RATE, wrap180, wrap360
from gateway.protocols.alpaca.simulator.telescope import (
    CONNECTING,
    NO_ACTION,
    NOT_SET,
    AlpacaError,
    AlpacaTelescope,
    ranged,
    rows,
)
from gateway.protocols.mechanics.axis_motor import LUNAR_RATE, SOLAR_RATE

#: The rates of tracking: sidereal, lunar, solar.
DRIVES = (SIDEREAL_RATE, LUNAR_RATE, SOLAR_RATE)


def read(sim: AlpacaTelescope, name: str, *values: Any) -> Any:
    """Return the value of a member: what it is made to tell, or what it has. Raises Refusal."""
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
    """Return the target in degrees; a right ascension in hours and a declination replace it. Raises Refusal."""
    if ra is not None and dec is not None:
        sim.target = [ranged(ra, 0.0, 24.0, "RightAscension") * 15.0, ranged(dec, -90.0, 90.0, "Declination")]
    return _set(sim.target[0]), _set(sim.target[1])


def _set(value: float | None) -> float:
    if value is None:
        raise AlpacaError(NOT_SET, "The target has not been set")
    return value


def _side(sim: AlpacaTelescope, flipped: bool) -> int:
    """Return the side of the pier: 0 east, where the tube looks west, 1 west, -1 without a pier."""
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


def _put(name: str, low: float, high: float, unit: float = 1.0, at: int | None = None) -> Callable[..., None]:
    """Return what keeps a value within these limits in an attribute, or in one place of a list."""

    def put(sim: AlpacaTelescope, value: float) -> None:
        value = ranged(value, low, high, name) * unit
        if at is None:
            setattr(sim, name, value)
        else:
            getattr(sim, name)[at] = value

    return put


def _locate(field: str, most: float) -> Callable[..., None]:
    return lambda sim, degrees: sim.mechanics.relocate(
        sim.now, sim.sky._replace(**{field: ranged(degrees, -most, most, field)})
    )


WRITES: dict[str, Callable[..., None]] = {
    "abortslew": AlpacaTelescope.abort, "action": _action, "connect": lambda sim: _connect(sim, True, CONNECTING),
    "connected": _connect, "disconnect": lambda sim: _connect(sim, False),
    "findhome": lambda sim: sim.go(sim.start, "home"), "guideratedeclination": _put("guides", 0.0, SIDEREAL_RATE, at=1),
    "guideraterightascension": _put("guides", 0.0, SIDEREAL_RATE, at=0), "moveaxis": AlpacaTelescope.move_at_rate,
    "park": AlpacaTelescope.park, "pulseguide": _pulse,
    "setpark": lambda sim: setattr(sim, "park_at", sim.mechanics.axes(sim.now)),
    "siteelevation": _put("elevation", -300.0, 10_000.0), "sitelatitude": _locate("latitude", 90.0),
    "sitelongitude": _locate("longitude", 180.0), "synctocoordinates": _sync, "synctotarget": _sync,
    "targetdeclination": _put("target", -90.0, 90.0, at=1),
    "targetrightascension": _put("target", 0.0, 24.0, 15.0, at=0), "tracking": AlpacaTelescope.track,
    "trackingrate": _track_rate, "unpark": lambda sim: setattr(sim, "at", ""),
    "utcdate": AlpacaTelescope.set_clock,
    **dict.fromkeys(("slewtoaltaz", "slewtoaltazasync"), AlpacaTelescope.slew_altaz),
    **dict.fromkeys(("slewtocoordinates", "slewtocoordinatesasync", "slewtotarget", "slewtotargetasync"), _slew),
}  # fmt: skip
