"""The checks of ``doctor``: each examines some of the facts, says what they mean, and what to do about a problem.

A new check is a function and a row of ``CHECKS``. It also reports good results, so that the reader sees what was
examined. ``bad`` is reserved for problems that keep a gateway from working as it should: they make ``doctor`` fail.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime

from gateway.core.about import EARLIEST_VALID_TIME
from gateway.diagnostics.doctor.facts import BAD, GOOD, NOTE, CheckResult, Facts, Port, Said

#: The oldest and the newest version of Python that mount-gateway is tested with.
OLDEST_PYTHON, NEWEST_PYTHON = (3, 11), (3, 14)
#: What does not work without each extra.
MISSING_EXTRA_EFFECTS = {
    "library": "faint objects of NGC and IC and most HIP numbers are unknown; LX200 programs have no object library",
    "metrics": "the console has no figures for Prometheus",
    "mqtt": "the mounts cannot be shown on an MQTT broker",
}
DAY_SECONDS = 86400.0
#: Packages that are not needed if there is an almanac; a note appears if the almanac ends within so many days.
ASTROPY_PACKAGES, MIN_ALMANAC_DAYS = {"astropy", "astropy-iers-data", "numpy", "pyerfa"}, 10.0
#: The udev rule that makes ModemManager ignore all USB serial ports.
UDEV_RULE = 'SUBSYSTEM=="tty", ENV{ID_BUS}=="usb", ENV{ID_MM_PORT_IGNORE}="1"'
MODEM_MANAGER_ADVICE = (
    "if you use no modem: sudo systemctl disable --now ModemManager; else write the line "
    f"{UDEV_RULE} into /etc/udev/rules.d/99-telescope.rules, type sudo udevadm control --reload, and plug the adapter "
    "in again"
)


def check_python(facts: Facts) -> Iterator[Said]:
    """Check that mount-gateway is tested with this version of Python; also describe the computer."""
    version = ".".join(map(str, facts.python))
    summary = f"Python {version} on {facts.system}; mount-gateway {facts.version}"
    tried = "{}.{} to {}.{}".format(*OLDEST_PYTHON, *NEWEST_PYTHON)
    if facts.python[:2] < OLDEST_PYTHON:
        yield BAD, f"{summary}: it is too old", f"install Python {tried}, and reinstall mount-gateway with it"
    elif facts.python[:2] > NEWEST_PYTHON:
        yield (
            NOTE,
            f"{summary}: it is newer than those mount-gateway is tested with",
            f"if something fails, use {tried}",
        )
    else:
        yield GOOD, summary, ""


def check_packages(facts: Facts) -> Iterator[Said]:
    """Check that every required package is installed in a suitable version."""
    needed = [package for package in facts.packages if not (facts.lacks_astropy and package.name in ASTROPY_PACKAGES)]
    wrong = [package for package in needed if not package.fits]
    for package in wrong:
        state = f"version {package.version} is installed" if package.version else "is not installed"
        mend = f"{facts.pip} install --upgrade '{package.name}{package.required_versions}'"
        yield BAD, f"{package.name} {state}, and {package.required_versions or 'any version'} is needed", mend
    if not facts.packages:
        again = f"{facts.pip} install '.' in the folder of mount-gateway"
        yield NOTE, "mount-gateway runs from its source without being installed: versions cannot be compared", again
    elif not wrong:
        yield GOOD, ", ".join(f"{package.name} {package.version}" for package in needed), ""


def check_extras(facts: Facts) -> Iterator[Said]:
    """List the extras that are not installed."""
    for extra, names in sorted(facts.missing_extras.items()):
        without = MISSING_EXTRA_EFFECTS.get(extra, f"the extra {extra} does not work")
        yield (
            NOTE,
            f"{' and '.join(names)} not installed: {without}",
            f"{facts.pip} install --upgrade {' '.join(names)}",
        )
    if facts.packages and not facts.missing_extras:
        yield GOOD, "all extras are installed", ""


def check_clock(facts: Facts) -> Iterator[Said]:
    """Check that the clock is not earlier than this software's release, and that a time source keeps it right."""
    now = _date_text(facts.now, "%Y-%m-%d %H:%M:%S UTC")
    set_it = "sudo timedatectl set-ntp true with a network; without one sudo date -u -s 'YYYY-MM-DD HH:MM:SS'"
    least = max(EARLIEST_VALID_TIME, facts.published or 0.0)
    if facts.now < least:
        yield (
            BAD,
            f"this computer's clock has lost the time: it shows {now}, and the installed astronomy data are of "
            f"{_date_text(least)}",
            f"set it: {set_it}. A mount with GPS has its own",
        )
    elif facts.clock_synchronized is False:
        yield (
            NOTE,
            f"this computer's clock shows {now}, and no time server or GPS keeps it right",
            f"compare it with another clock; 4 s are 1' on the sky. To keep it right: {set_it}",
        )
    else:
        source = (
            ", set by a time server"
            if facts.clock_synchronized
            else "; this system does not say whether a time server sets it"
        )
        yield GOOD, f"this computer's clock shows {now}{source}", ""


def check_astronomy(facts: Facts) -> Iterator[Said]:
    """Check that positions in the sky can be calculated: by astropy, or from an almanac of another computer."""
    yield _check_almanac(facts) if facts.lacks_astropy else (GOOD, "the sky is calculated by astropy", "")


def _check_almanac(facts: Facts) -> Said:
    calculate = "mount-gateway almanac FILE --days 400 on a computer with astropy, and run --almanac FILE here"
    if facts.almanac_until is not None:
        covers = f"astropy is not installed, and not needed: the almanac lasts until {_date_text(facts.almanac_until)}"
        soon = facts.almanac_until < facts.now + MIN_ALMANAC_DAYS * DAY_SECONDS
        return (NOTE, covers, calculate) if soon else (GOOD, covers, "")
    if any(running.sky_source.startswith("almanac of") for running in facts.gateways):
        return (
            GOOD,
            "astropy is not installed, and not needed: the running gateway has an almanac for today (doctor "
            "--almanac FILE shows more)",
            "",
        )
    return (
        BAD,
        "astropy is not installed, and no almanac is known for today: the Sun is within 0.01 degrees, the Moon within "
        "0.04, and there are no planets",
        f"if you have an almanac, type doctor --almanac FILE; else {calculate}, or {facts.pip} install astropy",
    )


def check_ports(facts: Facts) -> Iterator[Said]:
    """Check that this user may open every serial port, and that no other program has it open."""
    if not facts.ports:
        yield (
            NOTE,
            "there is no serial port",
            "plug the USB adapter in, unless the mount is reached over the network; dmesg | tail shows whether this "
            "computer noticed",
        )
    processes = {running.pid for running in facts.gateways}
    for port in facts.ports:
        called = f"{port.name} ({port.about})" if port.about else port.name
        if not port.permitted:
            yield BAD, f"{called}: your user may not open it", _permission_advice(facts, port)
        elif port.holder and not any(f"(process {process})" in port.holder for process in processes):
            yield (
                BAD,
                f"{called} is in use by {port.holder}",
                "close that program, or let it connect to the gateway instead of the port",
            )
        else:
            used = f"in use by a gateway: {port.holder}" if port.holder else "free, and your user may open it"
            yield GOOD, f"{called}: {used}", ""


def _permission_advice(facts: Facts, port: Port) -> str:
    if port.group in facts.groups and port.group not in facts.active_groups:
        return f"log out and in again: your new group {port.group} counts from the next login"
    if port.group in facts.active_groups:
        return f"ls -l {port.name} tells who may: the group {port.group}, which you are in, has no right to write"
    return f"sudo usermod -aG {port.group} $USER, then log out and in again"


def check_disturbers(facts: Facts) -> Iterator[Said]:
    """Check that no program is running that is known to disturb serial ports."""
    usb = [port for port in facts.ports if port.usb]
    said = False
    if process := facts.meddlers.get("ModemManager"):
        exposed = [port.name for port in usb if not port.modem_manager_ignores]
        if exposed:
            said = True
            yield (
                BAD,
                f"ModemManager (process {process}) looks for modems: when a USB serial port is plugged in it may write "
                f"AT to it, which a mount can take for commands ({', '.join(exposed)})",
                MODEM_MANAGER_ADVICE,
            )
        elif not usb:
            said = True
            yield (
                NOTE,
                f"ModemManager (process {process}) runs: it may write AT to a USB serial port that is plugged in",
                MODEM_MANAGER_ADVICE,
            )
    if process := facts.meddlers.get("brltty"):
        said = True
        yield (
            NOTE if usb else BAD,
            f"brltty (process {process}) looks for braille displays: it takes some USB adapters (CH340, CP210x, FTDI) "
            "away, and their port vanishes",
            "if nobody here reads braille: sudo systemctl mask --now brltty brltty-udev, and plug the adapter in again",
        )
    if not said:
        yield GOOD, "no program is running that is known to write to serial ports unasked", ""


def check_state_folder(facts: Facts) -> Iterator[Said]:
    """Check that the state folder can be written to."""
    if facts.state_problem:
        yield (
            BAD,
            f"the state folder {facts.state_folder} cannot be written to ({facts.state_problem}): after a crash in "
            "motion the mount would not be stopped, and sites and parking are forgotten",
            f"make it yours: sudo chown -R $USER {facts.state_folder}; or name another one with --state",
        )
    else:
        yield GOOD, f"the state folder {facts.state_folder} can be written to", ""


def check_gateways(facts: Facts) -> Iterator[Said]:
    """List the running gateways, and whether they can be queried."""
    hidden: dict[tuple[str, bool], list[str]] = {}
    for running in facts.gateways:
        if running.mount:
            folder = f", state folder {running.state_folder}" if running.state_folder else ""
            yield GOOD, f"a gateway runs for {running.mount} (process {running.pid}{folder})", ""
            for place in running.addresses:
                yield GOOD, f"{running.mount}: {place}", ""
        else:
            hidden.setdefault((running.user, running.is_other_users), []).append(str(running.pid))
    for (user, foreign), numbers in hidden.items():
        which = f"process {numbers[0]}" if len(numbers) == 1 else f"processes {', '.join(numbers)}"
        yield (
            NOTE,
            f"{'a gateway' if len(numbers) == 1 else 'gateways'} of {user} cannot be asked from here: {which}",
            f"ask as {user} or as root" if foreign else "name its state folder: mount-gateway status --state PATH",
        )
    if not facts.gateways:
        yield GOOD, "no gateway runs now", ""


def _date_text(unix: float, date_format: str = "%Y-%m-%d") -> str:
    return datetime.fromtimestamp(unix, UTC).strftime(date_format)


#: The checks by name, in the order of the report.
CHECKS: dict[str, Callable[[Facts], Iterator[Said]]] = {
    "python": check_python,
    "packages": check_packages,
    "extras": check_extras,
    "ports": check_ports,
    "meddlers": check_disturbers,
    "clock": check_clock,
    "astronomy": check_astronomy,
    "state": check_state_folder,
    "gateways": check_gateways,
}


def run_checks(facts: Facts) -> list[CheckResult]:
    """Run all checks and return their results, in the order of `CHECKS`."""
    return [CheckResult(name, *said) for name, look in CHECKS.items() for said in look(facts)]
