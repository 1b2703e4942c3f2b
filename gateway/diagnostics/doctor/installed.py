"""The installed packages and extras, and how long the astronomy data last.

This is read from pip's metadata and from the data files themselves; nothing is imported.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement

from gateway.diagnostics.doctor.facts import Package

PRODUCT, DATA = "mount-gateway", "astropy-iers-data"
#: Extras that only developers of mount-gateway need.
DEVELOPING = ("test", "judges", "dev", "docs", "single-file")
_UNIX_EPOCH_MJD, _DAY = 40587.0, 86400.0


def version(name: str) -> str:
    """Return the version of an installed package; empty if it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


def needed(product: str = PRODUCT, extra: str = "") -> Iterator[Package]:
    """Yield the packages that the product, or only one of its extras, requires on this system."""
    try:
        lines = importlib.metadata.requires(product) or []
    except importlib.metadata.PackageNotFoundError:
        return
    for line in lines:
        try:
            wanted = Requirement(line)
        except InvalidRequirement:  # written by a tool newer than the library that reads it here
            continue
        always = wanted.marker is None or wanted.marker.evaluate({"extra": ""})
        if always if not extra else not always and wanted.marker and wanted.marker.evaluate({"extra": extra}):
            found = version(wanted.name)
            fits = bool(found) and wanted.specifier.contains(found, prereleases=True)
            yield Package(wanted.name, str(wanted.specifier), found, fits)


def missing_extras(product: str = PRODUCT) -> dict[str, list[str]]:
    """Return the packages that are not installed, by extra."""
    try:
        extras = importlib.metadata.metadata(product).get_all("Provides-Extra") or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    wanted = {extra: needed(product, extra) for extra in extras if extra not in DEVELOPING}
    missing = {extra: [package.name for package in packages if not package.fits] for extra, packages in wanted.items()}
    return {extra: names for extra, names in missing.items() if names}


# --- astronomy data -------------------------------------------------------------------------------------------------


def published(release: str) -> float | None:
    """Return the date of a release of the astronomy data, Unix seconds; its version is ``0.2026.11.2.0.34.55``."""
    found = re.match(r"\d+\.(\d{4})\.(\d+)\.(\d+)", release)
    if found is None:
        return None
    year, month, day = map(int, found.groups())
    return datetime(year, month, day, tzinfo=UTC).timestamp()


def rotation_until() -> float | None:
    """Return the last day for which UT1 is observed or predicted, Unix seconds; None if it cannot be read."""
    path = _data("finals2000A.all")
    try:
        lines = [] if path is None else path.read_bytes().splitlines()
        day = next(float(line[7:15]) for line in reversed(lines) if line[58:68].strip())
    except (OSError, ValueError, StopIteration):
        return None
    return (day - _UNIX_EPOCH_MJD) * _DAY


def leap_seconds_until() -> float | None:
    """Return the day on which the list of leap seconds expires, Unix seconds; None if it cannot be read."""
    path = _data("Leap_Second.dat")
    try:
        text = "" if path is None else path.read_text("ascii", "replace")
        found = re.search(r"File expires on (\d+ \w+ \d{4})", text)
        return found and datetime.strptime(f"{found[1]} +0000", "%d %B %Y %z").timestamp()
    except (OSError, ValueError):
        return None


def _data(name: str) -> Path | None:
    """Return the path of an astronomy data file without importing astropy."""
    found = importlib.util.find_spec("astropy_iers_data")
    return None if found is None or found.origin is None else Path(found.origin).parent / "data" / name
