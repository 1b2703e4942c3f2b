"""Connects the telescope, and reads what it can do before the first operation depends on that.

Other programs may use the same telescope, so the driver never disconnects it.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, Unsupported
from gateway.protocols.alpaca.driver.contradictions import compare_equinox
from gateway.protocols.alpaca.driver.state import (
    ABILITY_MEMBERS,
    MAX_SPEED,
    MODELS,
    SIDEREAL_RATE,
    AlpacaDriver,
    read_member,
    read_member_again,
    read_state,
)
from gateway.protocols.base.driver import Remark, Send, Steps, Wait

#: The interface version from which ``connect`` returns before the telescope is connected; seconds between two checks
#: whether it is, and how many checks.
ASYNC_CONNECT_VERSION, CONNECT_CHECK_PERIOD, MAX_CONNECT_CHECKS = 4, 0.5, 120
#: A multiple of the sidereal rate that no guide rate reaches: some servers report percents instead of degrees a second.
MAX_GUIDE_RATE = 4.0
#: ASCOM's number of a coordinate system -> equinox.
EQUINOX_BY_NUMBER = {1: "jnow", 2: "j2000"}


def contact(mount: AlpacaDriver, _: object = None) -> Steps:
    """Connect the telescope, unless it is connected. Raises NoAnswer if that fails."""
    if (yield Send("connected"))["value"]:
        return
    try:
        if (yield from read_member(mount, "interfaceversion", 0)) < ASYNC_CONNECT_VERSION:
            raise Unsupported
        yield Send("connect")
    except Unsupported:
        yield Send("set_connected", {"on": True})
    for _look in range(MAX_CONNECT_CHECKS):
        if not (yield from read_member(mount, "connecting", False)) and (yield Send("connected"))["value"]:
            return
        yield Wait(CONNECT_CHECK_PERIOD)
    raise NoAnswer("The server does not connect the mount.")


def identity(mount: AlpacaDriver, _: op.GetIdentity) -> Steps:
    """Connect the telescope, read what it can do, and return the Identity."""
    yield from contact(mount)
    for request, member in ABILITY_MEMBERS.items():
        if not (yield from read_member_again(mount, member, False)):
            mount.absent_members.add(request)
    mount.model = mount.settings.model or (yield from _read_mount_kind(mount))
    for axis in (1, 2):
        able = yield from read_member_again(mount, "canmoveaxis", axis=axis - 1)
        mount.is_movable[axis] = able is not False  # a failure denies nothing
        mount.ranges[axis] = (
            () if able is False else _speed_ranges((yield from read_member_again(mount, "axisrates", axis=axis - 1)))
        )
    mount.hides_pier_side = bool(mount.german) and (yield from read_member_again(mount, "sideofpier")) not in (0, 1)
    system = yield from read_member_again(mount, "equatorialsystem", 0)
    mount.refracts = bool((yield from read_member_again(mount, "doesrefraction", False)))
    mount.equinox, mount.declares_equinox = EQUINOX_BY_NUMBER.get(system, "jnow"), system in EQUINOX_BY_NUMBER
    fits = None if mount.equinox_compared else (yield from compare_equinox(mount))
    if not mount.declares_equinox:
        mount.equinox = fits or "jnow"
        yield Remark(f"the server reports an equinox that the gateway does not know: {mount.equinox}")
    mount.lists_state = {"RightAscension", "Declination"} <= (yield from read_state(mount, read_member_again)).keys()
    east = (yield from read_member_again(mount, "guideraterightascension", 0.0)) / SIDEREAL_RATE
    north = (yield from read_member_again(mount, "guideratedeclination", 0.0)) / SIDEREAL_RATE
    mount.guide_rates = (east if 0.0 < east < MAX_GUIDE_RATE else 0.5, north if 0.0 < north < MAX_GUIDE_RATE else 0.5)
    yield from read_status(mount)
    name, version = (yield from read_member(mount, "name", "")), (yield from read_member(mount, "driverversion", ""))
    return op.Identity(product=str(name or "Alpaca telescope"), version=str(version or "?"), model=mount.model)


def _read_mount_kind(mount: AlpacaDriver) -> Steps:
    number = yield from read_member_again(mount, "alignmentmode")
    if number in range(len(MODELS)):
        return MODELS[number]
    yield Remark("the server does not report the kind of mount: the gateway assumes a German one; write alpaca:altaz@…")
    return "german"


def _speed_ranges(axis_rates: Any) -> tuple[tuple[float, float], ...]:
    """Return the speed ranges in an answer to AxisRates, degrees a second, cut off at ``MAX_SPEED``."""
    ranges = []
    for entry in axis_rates if isinstance(axis_rates, list) else ():
        with suppress(KeyError, TypeError, ValueError):
            low, high = sorted((abs(float(entry["Minimum"])), abs(float(entry["Maximum"]))))
            if high > 0.0 and low <= MAX_SPEED:
                ranges.append((low, min(high, MAX_SPEED)))
    return tuple(sorted(ranges))


def read_status(mount: AlpacaDriver) -> Steps:
    """Read whether the mount tracks and is parked. Discard tracking reported during a motion or just after it: this
    report may describe the motion. Discard parking reported during a goto. Values not reported remain unchanged.
    """
    state = (yield from read_state(mount)) if mount.lists_state else {}
    tracks, parked = state.get("Tracking"), state.get("AtPark")
    if tracks is None:
        tracks = yield from read_member(mount, "tracking")
    if parked is None:
        parked = yield from read_member(mount, "atpark")
    if tracks is not None and not mount.hand_rates and mount.goto is None and mount.now() >= mount.tracking_stale_until:
        mount.tracks = bool(tracks)
    if parked is not None and mount.goto is None:
        mount.parked = bool(parked)


def status(mount: AlpacaDriver, _: op.GetStatus) -> Steps:
    """Return the Status. Servers do not report whether the mount is aligned, so it counts as aligned."""
    yield from read_status(mount)
    native = mount.equatorial_mode if mount.equatorial else op.Tracking.ALTAZ
    mode = op.Tracking.OFF if mount.tracks is False else native
    return op.Status(tracking=mode, aligned=True, equatorial=mount.equatorial, wedge=mount.model == "polar")
