"""The checks: each looks at the facts for one thing, and says what it means and what to do about it.

A new one is a function and a row of ``CHECKS``. It says something also where all is well, so that a reader sees what
was looked at. ``bad`` is only what keeps a gateway from working as it should: ``doctor`` fails by it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime

from gateway.diagnostics.doctor.facts import BAD, GOOD, NOTE, Facts, Result, Said
from gateway.diagnostics.doctor.places import gateways, listeners, meddlers, ports, state_folder
from gateway.mount.site.site_clock import EARLIEST

#: The versions of Python that mount-gateway is tried with: the first and the last.
OLDEST, NEWEST = (3, 11), (3, 14)
#: What does not work without an extra.
WITHOUT = {
    "library": "M, NGC, IC, Caldwell and HIP numbers are unknown",
    "mdns": "surfaces are not announced by mDNS",
    "metrics": "the console has no figures for Prometheus",
    "mqtt": "the mounts cannot be shown on an MQTT broker",
}
#: Seconds in a day; days before their end at which data count as old.
DAY, SOON = 86400.0, 60.0


def python(facts: Facts) -> Iterator[Said]:
    """A version that is tried, and what to say of this computer in a report."""
    version = ".".join(map(str, facts.python))
    here = f"Python {version} on {facts.system}; mount-gateway {facts.version}"
    tried = "{}.{} to {}.{}".format(*OLDEST, *NEWEST)
    if facts.python[:2] < OLDEST:
        yield BAD, f"{here}: it is too old", f"install Python {tried}, and mount-gateway anew with it"
    elif facts.python[:2] > NEWEST:
        yield NOTE, f"{here}: it is newer than what mount-gateway was tried with", f"if something fails, take {tried}"
    else:
        yield GOOD, here, ""


def packages(facts: Facts) -> Iterator[Said]:
    """Everything that mount-gateway needs is there, in a version that will do."""
    again = f"{facts.pip} install --upgrade '.' in the folder that mount-gateway was installed from"
    wrong = [package for package in facts.packages if not package.fits]
    for package in wrong:
        here = f"version {package.version} is installed" if package.version else "is not installed"
        yield BAD, f"{package.name} {here}, and {package.needed or 'any version'} is needed", again
    if not facts.packages:
        yield NOTE, "mount-gateway runs from its source without being installed: versions cannot be compared", again
    elif not wrong:
        yield GOOD, ", ".join(f"{package.name} {package.version}" for package in facts.packages), ""


def extras(facts: Facts) -> Iterator[Said]:
    """What can be added."""
    for extra, names in sorted(facts.missing_extras.items()):
        without = WITHOUT.get(extra, f"what the extra {extra} is for does not work")
        yield (
            NOTE,
            f"{' and '.join(names)} not installed: {without}",
            f"{facts.pip} install '.[{extra}]' in the folder that mount-gateway was installed from",
        )
    if facts.packages and not facts.missing_extras:
        yield GOOD, "all extras are installed", ""


def clock(facts: Facts) -> Iterator[Said]:
    """Not before the time at which this software was made, and kept by somebody."""
    now = _day(facts.now, "%Y-%m-%d %H:%M:%S UTC")
    set_it = "sudo timedatectl set-ntp true with a network; without one sudo date -u -s 'YYYY-MM-DD HH:MM:SS'"
    least = max(EARLIEST, facts.published or 0.0)
    if facts.now < least:
        yield (
            BAD,
            f"this computer's clock has lost the time: it shows {now}, and the installed astronomy data are of "
            f"{_day(least)}",
            f"set it: {set_it}. A mount with GPS tells its own",
        )
    elif facts.clock_synchronized is False:
        yield (
            NOTE,
            f"this computer's clock shows {now}, and no time server or GPS keeps it right",
            f"compare it with another clock; 4 s are 1' on the sky. To have it kept: {set_it}",
        )
    else:
        kept = ", kept by a time server" if facts.clock_synchronized else "; whether it is kept cannot be told here"
        yield GOOD, f"this computer's clock shows {now}{kept}", ""


def astronomy(facts: Facts) -> Iterator[Said]:
    """How long the tables of the Earth's rotation and of the leap seconds go on."""
    tables = {
        "the Earth's rotation (IERS)": (facts.rotation_until, "sidereal time is off by a few hundredths of a second"),
        "the leap seconds": (facts.leap_seconds_until, "the next leap second, if there is one, is not known"),
    }
    renewal = f"{facts.pip} install --upgrade astropy-iers-data, while there is a network"
    for name, (until, effect) in tables.items():
        if until is None:
            yield BAD, f"the table of {name} cannot be read", f"{facts.pip} install --force-reinstall astropy-iers-data"
        elif facts.now > until:
            yield NOTE, f"the table of {name} ended on {_day(until)}: {effect}", renewal
        elif facts.now > until - SOON * DAY:
            yield NOTE, f"the table of {name} ends on {_day(until)}", renewal
        else:
            yield GOOD, f"the table of {name} goes on until {_day(until)}", ""


def _day(unix: float, form: str = "%Y-%m-%d") -> str:
    return datetime.fromtimestamp(unix, UTC).strftime(form)


#: By what they are called, in the order in which they are told.
CHECKS: dict[str, Callable[[Facts], Iterator[Said]]] = {
    "python": python,
    "packages": packages,
    "extras": extras,
    "ports": ports,
    "meddlers": meddlers,
    "clock": clock,
    "astronomy": astronomy,
    "network": listeners,
    "state": state_folder,
    "gateways": gateways,
}


def examine(facts: Facts) -> list[Result]:
    """What all checks say, in their order."""
    return [Result(name, *said) for name, look in CHECKS.items() for said in look(facts)]
