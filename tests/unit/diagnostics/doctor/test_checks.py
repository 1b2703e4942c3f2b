"""Every check on a computer where all is well, and on each of those where something is not."""

from __future__ import annotations

from datetime import UTC, datetime

from msgspec.structs import replace

from gateway.diagnostics.doctor.checks import CHECKS, run_checks
from gateway.diagnostics.doctor.facts import BAD, GOOD, NOTE, CheckResult, Facts, GatewayFacts, Package, Port
from tests.support.each import each


def at(day: str) -> float:
    return datetime.fromisoformat(day).replace(tzinfo=UTC).timestamp()


USB = Port("/dev/ttyUSB0", "FT232R")
#: A computer with which nothing is wrong.
WELL = Facts(
    version="1.0",
    python=(3, 12, 1),
    system="Linux 6.1 (aarch64)",
    now=at("2026-06-01"),
    published=at("2026-05-04"),
    almanac_until=None,
    packages=[Package("astropy", ">=8.0", "8.0.2"), Package("pyserial", ">=3.5", "3.5")],
    missing_extras={},
    ports=[USB],
    groups={"me", "dialout"},
    active_groups={"me", "dialout"},
    clock_synchronized=True,
    meddlers={},
    state_folder="/home/me/.local/state/mount-gateway",
    state_problem="",
    gateways=[],
    pip="/here/pip",
)


#: Packages where astropy and what it needs are left out.
LEAN = [*(Package(name, "", "", False) for name in ("astropy", "numpy", "pyerfa")), WELL.packages[1]]


def of(check: str, facts: Facts) -> list[CheckResult]:
    return [result for result in run_checks(facts) if result.check == check]


def test_doctor_on_a_healthy_computer_reports_ok_and_suggests_nothing() -> None:
    results = run_checks(WELL)
    assert {result.check for result in results} == set(CHECKS)
    assert {(result.state, result.do) for result in results} == {(GOOD, "")}


@each(
    ("check", "facts", "state", "found", "do"),
    [
        ("python", {"python": (3, 10, 9)}, BAD, "too old", "install Python 3.11 to 3.14"),
        ("python", {"python": (3, 15, 0)}, NOTE, "newer than", "3.11 to 3.14"),
        ("packages", {"packages": [Package("numpy", ">=1.2", "", False)]}, BAD, "numpy is not installed", "/here/pip"),
        (
            "packages",
            {"packages": [Package("pyserial", ">=3.5", "3.4", False)]},
            BAD,
            "pyserial version 3.4 is installed",
            "/here/pip install",
        ),
        ("packages", {"packages": []}, NOTE, "without being installed", "/here/pip install"),
        ("extras", {"missing_extras": {"library": ["pyongc"]}}, NOTE, "pyongc not installed", "--upgrade pyongc"),
        ("extras", {"missing_extras": {"other": ["a", "b"]}}, NOTE, "a and b not installed", "install --upgrade a b"),
        ("ports", {"ports": []}, NOTE, "no serial port", "plug the USB adapter in"),
        (
            "ports",
            {"ports": [replace(USB, permitted=False)], "groups": {"me"}, "active_groups": {"me"}},
            BAD,
            "/dev/ttyUSB0 (FT232R): your user may not open it",
            "sudo usermod -aG dialout $USER",
        ),
        (
            "ports",
            {"ports": [replace(USB, permitted=False)], "active_groups": {"me"}},
            BAD,
            "your user may not open it",
            "log out and in again",
        ),
        ("ports", {"ports": [replace(USB, permitted=False)]}, BAD, "your user may not open it", "ls -l /dev/ttyUSB0"),
        (
            "ports",
            {"ports": [replace(USB, holder="indi_lx200 (process 77)")]},
            BAD,
            "in use by indi_lx200 (process 77)",
            "close that program",
        ),
        (
            "ports",
            {
                "ports": [replace(USB, holder="python (process 77)")],
                "gateways": [GatewayFacts(77, "nexstar@/dev/ttyUSB0")],
            },
            GOOD,
            "in use by a gateway: python (process 77)",
            "",
        ),
        (
            "meddlers",
            {"meddlers": {"ModemManager": 612}},
            BAD,
            "ModemManager (process 612)",
            'ENV{ID_MM_PORT_IGNORE}="1"',
        ),
        ("meddlers", {"meddlers": {"ModemManager": 612}, "ports": []}, NOTE, "AT", "systemctl disable --now"),
        (
            "meddlers",
            {"meddlers": {"ModemManager": 612}, "ports": [replace(USB, modem_manager_ignores=True)]},
            GOOD,
            "no program",
            "",
        ),
        ("meddlers", {"meddlers": {"brltty": 613}}, NOTE, "brltty (process 613)", "systemctl mask --now brltty"),
        ("meddlers", {"meddlers": {"brltty": 613}, "ports": []}, BAD, "their port vanishes", "plug the adapter in"),
        ("clock", {"now": at("2026-05-03")}, BAD, "shows 2026-05-03", "timedatectl set-ntp true"),
        ("clock", {"now": at("2023-12-31"), "published": None}, BAD, "has lost the time", "timedatectl"),
        ("clock", {"clock_synchronized": False}, NOTE, "no time server", "timedatectl set-ntp true"),
        ("clock", {"clock_synchronized": None}, GOOD, "does not say", ""),
        ("packages", {"packages": LEAN, "almanac_until": at("2027-05-01")}, GOOD, "pyserial 3.5", ""),
        ("astronomy", {"packages": LEAN, "almanac_until": at("2027-05-01")}, GOOD, "lasts until 2027-05-01", ""),
        ("astronomy", {"packages": LEAN, "almanac_until": at("2026-06-10")}, NOTE, "until 2026-06-10", "--days 400"),
        ("astronomy", {"packages": LEAN}, BAD, "no almanac is known for today", "run --almanac FILE"),
        (
            "astronomy",
            {"packages": LEAN, "gateways": [GatewayFacts(77, "nexstar@sim", sky_source="almanac of 2026-06-01")]},
            GOOD,
            "the running gateway has an almanac",
            "",
        ),
        ("state", {"state_problem": "permission denied"}, BAD, "(permission denied)", "sudo chown -R $USER /home/me"),
        ("gateways", {"gateways": [GatewayFacts(77, "nexstar@sim")]}, GOOD, "runs for nexstar@sim (process 77)", ""),
        (
            "gateways",
            {"gateways": [GatewayFacts(77, user="user pi", is_other_users=True)]},
            NOTE,
            "of user pi",
            "or as root",
        ),
        (
            "gateways",
            {"gateways": [GatewayFacts(77, user="the user me"), GatewayFacts(78, user="the user me")]},
            NOTE,
            "processes 77, 78",
            "--state PATH",
        ),
    ],
)  # fmt: skip
def test_doctor_reports_each_fault_with_its_remedy(
    check: str, facts: dict[str, object], state: str, found: str, do: str
) -> None:
    results = of(check, replace(WELL, **facts))
    result = next((result for result in results if found in result.found), None)
    assert result is not None, results
    assert result.state == state and do in result.do and bool(result.do) == bool(do)
    unmoved = [result for result in run_checks(replace(WELL, **facts)) if result.check != check]
    assert not any(result.state == BAD for result in unmoved)


def test_doctor_does_not_blame_modem_manager_for_a_built_in_port() -> None:
    facts = replace(WELL, meddlers={"ModemManager": 612}, ports=[USB, Port("/dev/ttyS0", usb=False)])
    [result] = of("meddlers", facts)
    assert "ttyUSB0" in result.found and "ttyS0" not in result.found
