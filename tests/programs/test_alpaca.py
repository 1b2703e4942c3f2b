"""ASCOM's own client, alpyca, on four mounts: discovery, management, and every member of Telescope."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.support.process import Running

telescope = pytest.importorskip("alpaca.telescope", reason="alpyca is not installed")
from alpaca import discovery, management  # noqa: E402
from alpaca.exceptions import (  # noqa: E402
    InvalidOperationException,
    InvalidValueException,
    NotConnectedException,
    NotImplementedException,
    ParkedException,
    ValueNotSetException,
)

Telescope, Axes, Guide = telescope.Telescope, telescope.TelescopeAxes, telescope.GuideDirections
PATIENCE = 120.0
FORK, POLAR, GERMAN = telescope.AlignmentModes
SIDEREAL = telescope.DriveRates.driveSidereal
#: By mount: how it is built, and what it has not.
MOUNTS = {
    "nexstar:6-8se": (FORK, {"FindHome"}),
    "nexstar:cge": (GERMAN, {"FindHome"}),
    "lx200:lx200": (POLAR, {"FindHome", "Park", "SetTracking", "SetGuideRates"}),
    "lx200:lx200gps": (FORK, set()),
}
#: Members that no mount here has.
NOWHERE = ("ApertureArea", "ApertureDiameter", "DoesRefraction", "FocalLength", "SlewSettleTime")
DOUBLES = ("Altitude", "Azimuth", "Declination", "DeclinationRate", "GuideRateDeclination", "GuideRateRightAscension",
           "RightAscension", "RightAscensionRate", "SiderealTime", "SiteLatitude", "SiteLongitude")  # fmt: skip
TRUTHS = ("AtHome", "AtPark", "CanFindHome", "CanPark", "CanPulseGuide", "CanSetDeclinationRate", "CanSetGuideRates",
          "CanSetPark", "CanSetPierSide", "CanSetRightAscensionRate", "CanSetTracking", "CanSlew", "CanSlewAltAz",
          "CanSlewAltAzAsync", "CanSlewAsync", "CanSync", "CanSyncAltAz", "CanUnpark", "Connected", "Connecting",
          "IsPulseGuiding", "Slewing", "Tracking")  # fmt: skip
WORDS = ("Description", "DriverVersion", "Name")


@contextmanager
def gateway(mount: str, state: Path, *more: str) -> Iterator[str]:
    """-> HOST:PORT of the surface over a simulated mount that is quick."""
    running = Running(
        "run", "--mount", f"{mount}@sim", "--surface", "alpaca@tcp://127.0.0.1:0", "--state", str(state),
        "--speed", "8", "--sun", "0", *(more or ("--no-discovery",)),
    )  # fmt: skip
    try:
        yield running.ready().split()[0].removeprefix("tcp://")
    finally:
        assert running.end() == 0


def until(holds: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.1)


@pytest.mark.slow
@pytest.mark.parametrize("mount", MOUNTS)
def test_alpyca_reads_every_member_of_a_telescope(mount: str, tmp_path: Path) -> None:
    build, lacks = MOUNTS[mount]
    with gateway(mount, tmp_path) as address:
        scope = Telescope(address, 0)
        assert 0.0 <= scope.RightAscension < 24.0, "whoever has not connected yet may read"
        with pytest.raises(NotConnectedException):
            scope.Tracking = True
        scope.Connect()
        until(lambda: not scope.Connecting, "connected")
        assert scope.Connected
        _properties(scope, build, lacks)
        _targets_and_site(scope)
        _slews(scope, lacks)
        _by_hand(scope, lacks)
        _parks(scope, lacks)
        _not_here(scope)
        scope.Disconnect()
        assert not scope.Connected
        with pytest.raises(NotConnectedException):
            _ = scope.RightAscension


def _properties(scope: Any, build: Any, lacks: set[str]) -> None:
    assert {name: type(getattr(scope, name)) for name in DOUBLES} == dict.fromkeys(DOUBLES, float)
    assert {name: type(getattr(scope, name)) for name in TRUTHS} == dict.fromkeys(TRUTHS, bool)
    assert {name: type(getattr(scope, name)) for name in WORDS} == dict.fromkeys(WORDS, str)
    for name in NOWHERE:
        with pytest.raises(NotImplementedException):
            getattr(scope, name)
    assert scope.AlignmentMode is build and scope.InterfaceVersion == 4 and scope.SupportedActions == ["GotoEndedShort"]
    assert scope.EquatorialSystem is telescope.EquatorialCoordinateType.equTopocentric
    side = scope.SideOfPier
    assert (side is telescope.PierSide.pierUnknown) is (build is not GERMAN)
    later = scope.DestinationSideOfPier((scope.SiderealTime - 2.0) % 24.0, 20.0)
    sooner = scope.DestinationSideOfPier((scope.SiderealTime + 2.0) % 24.0, 20.0)
    expected = (0, 1) if build is GERMAN else (-1, -1)
    assert (later, sooner) == tuple(map(telescope.PierSide, expected)), "looking west from the east side, and back"
    for what in ("FindHome", "Park", "SetTracking", "SetGuideRates"):
        assert getattr(scope, f"Can{what}") is (what not in lacks), what
    assert scope.TrackingRate is SIDEREAL and SIDEREAL in scope.TrackingRates
    rates = scope.AxisRates(Axes.axisPrimary)
    assert rates and all(0.0 < rate.Minimum <= rate.Maximum for rate in rates)
    assert scope.CanMoveAxis(Axes.axisSecondary) and not scope.CanMoveAxis(Axes.axisTertiary)
    assert {state["Name"] for state in scope.DeviceState} >= {"RightAscension", "Slewing", "Tracking", "UTCDate"}
    assert abs((scope.UTCDate - datetime.now(UTC)).total_seconds()) < 60.0


def _targets_and_site(scope: Any) -> None:
    assert scope.SiteElevation == 0.0
    for name in ("TargetRightAscension", "TargetDeclination"):
        with pytest.raises((ValueNotSetException, InvalidOperationException)):
            getattr(scope, name)
    scope.SiteElevation = 520.0
    assert scope.SiteElevation == 520.0
    scope.SiteLatitude = scope.SiteLatitude
    scope.UTCDate = datetime.now(UTC)
    for name, wrong in (("TargetRightAscension", 24.5), ("TargetDeclination", -91.0), ("SiteLatitude", 91.0),
                        ("SiteLongitude", 181.0), ("SiteElevation", 20000.0), ("TrackingRate", 7)):  # fmt: skip
        with pytest.raises((InvalidValueException, ValueError)):
            setattr(scope, name, telescope.DriveRates.driveKing if name == "TrackingRate" else wrong)


def _slews(scope: Any, lacks: set[str]) -> None:
    until(lambda: scope.Tracking, "tracking")
    ra = (scope.SiderealTime - 1.0) % 24.0
    until(lambda: _heard(lambda: scope.SlewToCoordinatesAsync(ra, 30.0)), "a Meade that has been told the date")
    assert scope.Slewing and scope.TargetDeclination == 30.0
    until(lambda: not scope.Slewing, "arrival")
    assert abs(scope.RightAscension - ra) < 0.02 and abs(scope.Declination - 30.0) < 0.2
    scope.TargetRightAscension, scope.TargetDeclination = (ra - 0.2) % 24.0, 32.0
    scope._put("slewtotarget", PATIENCE)  # alpyca itself has no calls that wait
    assert not scope.Slewing and abs(scope.Declination - 32.0) < 0.2, "it was answered on arrival"
    scope.SyncToTarget()
    scope.SlewToTargetAsync()
    scope.AbortSlew()
    until(lambda: not scope.Slewing, "the stop")
    with pytest.raises(InvalidValueException):
        scope.SlewToCoordinatesAsync(25.0, 0.0)
    with pytest.raises(InvalidOperationException):
        scope.SlewToCoordinatesAsync(ra, -80.0)
    if "SetTracking" in lacks:
        with pytest.raises(NotImplementedException):
            scope.Tracking = False
        return
    with pytest.raises(InvalidOperationException):
        scope.SlewToAltAzAsync(180.0, 50.0)
    scope.Tracking = False
    until(lambda: not scope.Tracking, "tracking is off")
    with pytest.raises(InvalidOperationException):
        scope.SlewToCoordinatesAsync(ra, 30.0)
    scope.SlewToAltAzAsync(190.0, 50.0)
    until(lambda: not scope.Slewing, "arrival over the horizon")
    scope.Tracking = True
    until(lambda: scope.Tracking, "tracking")


def _heard(order: Callable[[], None]) -> bool:
    """Whether the mount had time for it."""
    try:
        order()
    except InvalidOperationException as error:
        if "busy" not in str(error):
            raise
        return False
    return True


def _by_hand(scope: Any, lacks: set[str]) -> None:
    fastest = scope.AxisRates(Axes.axisPrimary)[-1].Maximum
    scope.MoveAxis(Axes.axisPrimary, fastest)
    assert scope.Slewing
    scope.MoveAxis(Axes.axisPrimary, 0.0)
    until(lambda: not scope.Slewing, "the axis rests")
    with pytest.raises(InvalidValueException):
        scope.MoveAxis(Axes.axisPrimary, fastest * 2.0)
    until(lambda: scope.Tracking, "tracking goes on")
    scope.PulseGuide(Guide.guideNorth, 4000)
    scope.PulseGuide(Guide.guideWest, 4000)
    assert scope.IsPulseGuiding and not scope.Slewing
    until(lambda: not scope.IsPulseGuiding, "the pulses are over")
    with pytest.raises(InvalidValueException):
        scope.PulseGuide(Guide.guideNorth, -1)
    if "SetGuideRates" not in lacks:
        scope.GuideRateDeclination = scope.GuideRateRightAscension = 0.0020890
        assert abs(scope.GuideRateDeclination - 0.0020890) < 1e-4
        with pytest.raises(InvalidValueException):
            scope.GuideRateRightAscension = 1.0
    scope.TrackingRate = SIDEREAL


def _parks(scope: Any, lacks: set[str]) -> None:
    if "FindHome" not in lacks:
        scope.FindHome()
        until(lambda: scope.AtHome or not scope.Slewing, "home")
        assert scope.AtHome
    else:
        with pytest.raises(NotImplementedException):
            scope.FindHome()
    if "Park" in lacks:
        for refused in (scope.Park, scope.Unpark):
            with pytest.raises(NotImplementedException):
                refused()
        return
    scope.Park()
    until(lambda: scope.AtPark, "parked")
    assert not scope.Slewing and not scope.Tracking and not scope.AtHome
    with pytest.raises(ParkedException):
        scope.SlewToCoordinatesAsync(1.0, 1.0)
    scope.Park()
    scope.Unpark()
    assert not scope.AtPark
    until(lambda: scope.Tracking, "tracking")


def _not_here(scope: Any) -> None:
    for refused in (
        scope.SetPark, lambda: scope.SyncToAltAz(10.0, 10.0), lambda: scope.Action("x", ""),
        lambda: scope.CommandBlind("x", True), lambda: scope.CommandBool("x", True),
        lambda: scope.CommandString("x", True),
    ):  # fmt: skip
        with pytest.raises(NotImplementedException):
            refused()
    for name, value in (("RightAscensionRate", 1.0), ("DeclinationRate", 1.0), ("DoesRefraction", True),
                        ("SlewSettleTime", 1), ("SideOfPier", telescope.PierSide.pierEast)):  # fmt: skip
        with pytest.raises(NotImplementedException):
            setattr(scope, name, value)


def _loopback() -> list[SimpleNamespace]:
    here = SimpleNamespace(ip="127.0.0.1", network_prefix=8, is_IPv4=True, is_IPv6=False)
    return [SimpleNamespace(name="lo", nice_name="lo", index=1, ips=[here])]


@pytest.mark.slow
def test_alpyca_discovers_the_gateway_and_lists_its_devices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The question is sent to this computer alone."""
    monkeypatch.setattr(discovery.ifaddr, "get_adapters", _loopback)
    with gateway("nexstar:6-8se", tmp_path, "--discovery") as address:
        port = int(address.rpartition(":")[2])
        found = discovery.search_ipv4(numquery=2, timeout=2)
        assert f"127.0.0.1:{port}" in found, found
        assert management.apiversions(address) == [1]
        assert management.description(address)["ServerName"] == "mount-gateway"
        [device] = management.configureddevices(address)
        assert (device["DeviceType"], device["DeviceNumber"]) == ("Telescope", 0)
