"""The sky stage: whether altitude and azimuth, right ascension and declination, site and clocks agree.

A difference is reported as a contradiction between two sources: this check cannot determine which of them is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from gateway.astro.spherical import separation, wrap180
from gateway.core.errors import Fault
from gateway.core.operations import Values
from gateway.diagnostics.prove import reads
from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, SAME, Finding, StageReporter
from gateway.diagnostics.prove.telescope import CheckedMount
from gateway.mount.safety.admission.contradictions import contradictions
from gateway.mount.site.site_clock import COMPUTER_SOURCE, MOUNT_SOURCE, SourcedSite

#: Degrees by which reported altitude and azimuth may differ from calculated ones; the sky's motion meanwhile is less.
DIRECTION_TOLERANCE = 0.5
#: Seconds by which clocks may differ; degrees by which a longitude may differ from the middle of the time zone.
CLOCK_TOLERANCE, ZONE_TOLERANCE = 120.0, 45.0


async def run(telescope: CheckedMount, report: StageReporter) -> None:
    """Report all contradictions, and what agrees. Raises StageEnded."""
    sources = telescope.controller.sources
    sites, times = sources.sites(), sources.times()
    report.progress(0, 2, "site and clocks")
    doubts = list(contradictions(sites, times))
    for doubt in doubts:
        report.add(
            Finding(f"{doubt.sources[0]} and {doubt.sources[1]}", DIFFERS, doubt.text, "", "One of them is wrong.")
        )
    if not any(doubt.difference.endswith(" km") for doubt in doubts):
        report.add(_site_finding(telescope, sites))
    by_mount = next((time for time in times if time.source == MOUNT_SOURCE), None)
    computer = next((time for time in times if time.source == COMPUTER_SOURCE), None)
    if by_mount is None or computer is None:
        report.add(Finding("clock", NOT_MEASURABLE, "the mount reports no time"))
    elif abs(by_mount.unix - computer.unix) <= CLOCK_TOLERANCE:
        report.add(Finding("clock", SAME, f"{abs(by_mount.unix - computer.unix):.0f} s from this computer's"))
    report.progress(1, 2, "altitude and azimuth")
    report.add(await _check_az_alt(telescope))


def _site_finding(telescope: CheckedMount, sites: Sequence[SourcedSite]) -> Finding:
    """Return the finding on an undisputed site: whether the mount's longitude suits its zone, and two sources agree."""
    clock = telescope.controller.site_clock.mount_clock
    if not sites:
        return Finding("site", NOT_MEASURABLE, "no source has it; --site LATITUDE,LONGITUDE sets it")
    zone = clock[0].offset if clock is not None else 0.0  # a clock that is set to UTC says nothing
    away = abs(wrap180(sites[0].place.longitude - 15.0 * zone)) if zone else 0.0
    if sites[0].source == MOUNT_SOURCE and away > ZONE_TOLERANCE:
        means = "The longitude, its sign, or the zone is wrong: one of them."
        return Finding("site and zone", DIFFERS, f"{away:.0f}° from the longitude of its zone", "", means)
    if len(sites) > 1:
        return Finding("site", SAME, f"{sites[0].source} and {sites[1].source} agree")
    return Finding("site", NOT_MEASURABLE, f"only {sites[0].source} tells it")


async def _check_az_alt(telescope: CheckedMount) -> Finding:
    """Compare reported az and alt with those calculated from RA and Dec, unless one is unknown. Raises StageEnded."""
    what, driver = "altitude and azimuth against RA and Dec", telescope.driver
    overhead = driver.protocol.extra_table("prove.toml")["overhead"]
    if telescope.status.equatorial and "axes_of" in overhead:
        return Finding(what, NOT_MEASURABLE, "an equatorial mount tells its axes instead")
    values: Values = {}
    for name in filter(driver.supports, overhead["asks"]):
        with suppress(Fault):
            values |= (await reads.ask_mount(telescope, name)).fields
    look = await telescope.read_position()
    try:
        expected = telescope.controller.astrometry.horizontal(look.position)
    except Fault:
        return Finding(what, NOT_MEASURABLE, "the site is not known")
    if not {"az", "alt"} <= values.keys():
        return Finding(what, NOT_MEASURABLE, "it does not tell them")
    off = separation(values["az"], values["alt"], expected.az, expected.alt)
    if off <= DIRECTION_TOLERANCE:
        return Finding(what, SAME, f"{off:.1f}° apart")
    means = "Its alignment, its site or its clock do not belong together: align it again before a night."
    return Finding(what, DIFFERS, f"{off:.1f}° apart", "", means)
