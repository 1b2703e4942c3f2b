"""Collect the facts about this computer; nothing is changed, sent to a port or downloaded.

Some facts are only available on Linux, from ``/proc``, ``/run/udev`` and ``/etc/group``. What cannot be read is left
out: other users' processes, or udev data on a system without udev. Tests pass other folders to imitate a computer.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.metadata
import importlib.util
import os
import platform
import re
import shutil
import sys
import time
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from packaging.requirements import InvalidRequirement, Requirement

from gateway.app.control.exchange import ControlEndpoint, is_listening
from gateway.app.control.reach import Scope, ask_state, may_reach, search, unreachable_gateways
from gateway.app.status import State
from gateway.astro.ephemeris.almanac import DAY, load_stored
from gateway.core.about import full_version
from gateway.diagnostics.detect.ports import is_not_built_in, local_ports, port_holder
from gateway.diagnostics.doctor.facts import Facts, GatewayFacts, Package, Port
from gateway.system.computer_clock import is_clock_synchronised
from gateway.system.files import state_folder
from gateway.system.own_commands import pip_command
from gateway.system.processes import PROC_FOLDER
from gateway.system.runtime_folders import user_name
from gateway.transport.wires import group_of

PRODUCT_NAME, IERS_PACKAGE = "mount-gateway", "astropy-iers-data"
#: Extras that only developers of mount-gateway need.
DEVELOPER_EXTRAS = ("test", "judges", "dev", "docs", "single-file")


def installed_version(name: str) -> str:
    """Return the version of an installed package; empty if it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


def required_packages(product: str = PRODUCT_NAME, extra: str = "") -> Iterator[Package]:
    """Yield the packages that the product, or an extra of it, requires on this system."""
    try:
        lines = importlib.metadata.requires(product) or []
    except importlib.metadata.PackageNotFoundError:
        return
    for line in lines:
        try:
            requirement = Requirement(line)
        except InvalidRequirement:  # written by a tool newer than the library that reads it here
            continue
        always = requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        if always if not extra else not always and requirement.marker and requirement.marker.evaluate({"extra": extra}):
            installed = installed_version(requirement.name)
            fits = bool(installed) and requirement.specifier.contains(installed, prereleases=True)
            yield Package(requirement.name, str(requirement.specifier), installed, fits)


def missing_extras(product: str = PRODUCT_NAME) -> dict[str, list[str]]:
    """Return the missing packages of each extra that is not completely installed."""
    try:
        extras = importlib.metadata.metadata(product).get_all("Provides-Extra") or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    required = {extra: required_packages(product, extra) for extra in extras if extra not in DEVELOPER_EXTRAS}
    missing = {
        extra: [package.name for package in packages if not package.fits] for extra, packages in required.items()
    }
    return {extra: names for extra, names in missing.items() if names}


# --- astronomy data -------------------------------------------------------------------------------------------------


def release_date(release: str) -> float | None:
    """Return the date in a version of the astronomy data (``0.2026.11.2.0.34.55``), Unix seconds; None without one."""
    match = re.match(r"\d+\.(\d{4})\.(\d+)\.(\d+)", release)
    if match is None:
        return None
    year, month, day = map(int, match.groups())
    return datetime(year, month, day, tzinfo=UTC).timestamp()


#: Programs that are known to disturb serial ports.
PORT_DISTURBERS = ("ModemManager", "brltty")
#: Timeout of a gateway's answer, seconds.
ANSWER_TIMEOUT = 3.0
UDEV_FOLDER = Path("/run/udev/data")


def gather_facts(named_state_folder: str | None = None, almanac_file: str | None = None) -> Facts:
    """Collect the facts for the checks. Raises UserError if the named almanac file cannot be used."""
    folder = state_folder(named_state_folder)
    granted, active = user_and_active_groups()
    return Facts(
        version=full_version(),
        python=sys.version_info[:3],
        system=f"{platform.system()} {platform.release()} ({platform.machine()})",
        now=time.time(),
        published=release_date(installed_version(IERS_PACKAGE)),
        almanac_until=_almanac_until(time.time(), almanac_file),
        packages=list(required_packages()),
        missing_extras=missing_extras(),
        ports=list(list_ports()),
        groups=granted,
        active_groups=active,
        clock_synchronized=is_clock_synchronised(),
        meddlers=processes_named(PORT_DISTURBERS),
        state_folder=str(folder),
        state_problem=why_unwritable(folder),
        gateways=list(running_gateways(Scope(folder, folder_only=named_state_folder is not None))),
        pip=pip_command(),
    )


def _almanac_until(now: float, path: str | None) -> float | None:
    today = int(now // DAY)
    days = load_stored(path).count_days_from(today)
    return (today + days - 1) * DAY if days else None


def list_ports() -> Iterator[Port]:
    """List the serial ports of this computer without opening them, as programs may be using them."""
    for port in local_ports():
        yield Port(
            name=port.url,
            about=port.about,
            usb=is_not_built_in(port.url),
            permitted=os.name != "posix" or os.access(port.url, os.R_OK | os.W_OK),
            group=group_of(port.url),
            holder=port_holder(port.url),
            modem_manager_ignores=os.name == "posix" and modem_manager_ignores(port.url),
        )


def why_unwritable(folder: Path) -> str:
    """Return why files cannot be written to a folder; empty if they can, or if the folder could be created."""
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        return f"{existing} is not a folder"
    if not os.access(existing, os.W_OK | os.X_OK):
        return "permission denied" if existing == folder else f"permission denied in {existing}"
    return "the disk is full" if shutil.disk_usage(existing).free == 0 else ""


def running_gateways(scope: Scope) -> Iterator[GatewayFacts]:
    """Yield the gateways that can be queried, then those of which only the process is visible."""
    endpoints = [endpoint for _, endpoint in search(scope).gateways if is_listening(endpoint)]
    for endpoint, (places, sky) in zip(endpoints, asyncio.run(_query_gateways(endpoints)), strict=True):
        yield GatewayFacts(endpoint.pid, endpoint.title, addresses=places, state_folder=endpoint.state, sky_source=sky)
    for process in unreachable_gateways(scope):
        yield GatewayFacts(process.pid, user=user_name(process.user_id), is_other_users=not may_reach(process))


async def _query_gateways(endpoints: Sequence[ControlEndpoint]) -> list[tuple[tuple[str, ...], str]]:
    return await asyncio.gather(*map(_addresses_and_sky, endpoints))


async def _addresses_and_sky(endpoint: ControlEndpoint) -> tuple[tuple[str, ...], str]:
    """Return where clients connect to a gateway, and how it calculates the sky; both empty if it does not answer."""
    state = await ask_state(endpoint, fresh=False, timeout=ANSWER_TIMEOUT)
    return (tuple(map(str, state.served)), state.sky) if isinstance(state, State) else ((), "")


def processes_named(names: Collection[str], proc_folder: Path = PROC_FOLDER) -> dict[str, int]:
    """Return name -> process id of the running programs with these names; one process for each name."""
    results = {}
    for process in proc_folder.glob("[0-9]*"):
        with contextlib.suppress(OSError):
            name = (process / "comm").read_text().strip()
            if name in names:
                results[name] = int(process.name)
    return results


def modem_manager_ignores(device: str, udev_folder: Path = UDEV_FOLDER) -> bool:
    """Whether a udev rule tells ModemManager to ignore a port."""
    try:
        number = os.stat(device).st_rdev
        properties = (udev_folder / f"c{os.major(number)}:{os.minor(number)}").read_text()
    except OSError:
        return False
    return any(line in properties.splitlines() for line in ("E:ID_MM_PORT_IGNORE=1", "E:ID_MM_DEVICE_IGNORE=1"))


def user_and_active_groups() -> tuple[set[str], set[str]]:
    """Return the groups of this user, and those of this login session."""
    try:
        import grp
        import pwd
    except ImportError:
        return set(), set()
    every = grp.getgrall()
    active = {group.gr_name for group in every if group.gr_gid in (*os.getgroups(), os.getegid())}
    try:
        user = pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return active, active
    return active | {group.gr_name for group in every if user in group.gr_mem}, active
