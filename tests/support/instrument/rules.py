"""The rules about the Sun and the altitudes: how their refusals read, where they are, and how each is switched off."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any, NamedTuple
from unittest.mock import patch

from gateway.mount.safety.admission import slew_paths
from gateway.mount.site.astrometry import SunAvoidance
from gateway.mount.site.site_clock import SiteTimeSources

#: Where the rules are used.
ADMISSION, WATCH = "gateway.mount.safety.admission", "gateway.mount.safety.allow"
MOTIONS, ALTITUDES = f"{ADMISSION}.motions", f"{ADMISSION}.altitudes"


class Rule(NamedTuple):
    """``words``: of its refusals and ends. ``tried``: words of the attacks on which it is judged. ``off``: what carries
    it, and what replaces that.
    """

    words: tuple[str, ...]
    danger: str
    file: str
    tried: str
    off: tuple[tuple[str, Any], ...]


def _nothing(*_: Any, **__: Any) -> None:
    return None


def _every_way(mount: Any, limits: Any, journey: Any, stretch: float = 0.0) -> Any:
    return slew_paths.paths_of(mount, journey)


def _own_zenith(mount: Any, equatorial: bool) -> Any:
    return zeniths(mount, equatorial)[:1]


def _one_frame(self: SunAvoidance, frame: Any, ahead: float = 0.0) -> Any:
    return [sun for sun in suns(self, frame, ahead) if sun.sync_shift is None]


def _own(self: SunAvoidance, frame: Any, ahead: float = 0.0) -> Any:
    return [sun for sun in suns(self, frame, ahead) if sun.confirmed]


suns, zeniths = SunAvoidance.calculate_suns, slew_paths.zenith_readings
#: The first whose words fit a refusal is behind it.
RULES = {
    "altitude, watched": Rule(("stopped at the altitude",), "D2", "safety/allow.py", "arrows", (
        (f"{WATCH}.altitude", lambda view: ()),)),
    "the Sun, watched": Rule(("stopped at the Sun",), "D1", "safety/allow.py", "arrows at the Sun", (
        (f"{WATCH}.near_sun", lambda view: ()),)),
    "altitude after syncs": Rule(("syncs",), "D2", "safety/admission/altitudes.py", "a sync of", (
        (f"{ALTITUDES}.by_syncs", lambda *_: ()), ("gateway.mount.safety.watch.by_syncs", lambda *_: ()))),
    "altitude by other sources": Rule(("Too low",), "D2", "safety/admission/altitudes.py", "low gotos", (
        (f"{ALTITUDES}.by_others", lambda *_: ()), (f"{ADMISSION}.slew_paths.zeniths", _own_zenith))),
    "the way and altitudes": Rule(("way is too",), "D2", "safety/admission/slew_paths.py", "gotos anywhere above", (
        (f"{ADMISSION}.slew_paths.paths_within", _every_way),)),
    "the way and the Sun": Rule(("way there passes", "Past the Sun"), "D1", "safety/admission/slew_paths.py", "Sun", (
        (f"{MOTIONS}.are_clear", lambda *_: True),)),
    "the Sun of other sources": Rule(("Near the Sun by",), "D1", "site/astrometry.py", "to the Sun", (
        ("gateway.mount.site.astrometry.SunAvoidance.suns", _own),)),
    "the Sun where syncs put the tube": Rule(("by its axes",), "D1", "site/astrometry.py", "sync", (
        ("gateway.mount.site.astrometry.SunAvoidance.suns", _one_frame),)),
    "the Sun over the site before": Rule(("site before",), "D1", "site/site_clock.py", "nobody else", (
        ("gateway.mount.site.site_clock.BestSources.sites_for_sun", SiteTimeSources.sites),)),
    "the goal and the Sun": Rule(("Sun",), "D1", "safety/admission/motions.py", "to the Sun", (
        ("gateway.mount.site.astrometry.SunAvoidance.distance", lambda *_: 180.0),)),
    "the goal's altitude": Rule(("orizon", "Limit"), "D2", "safety/admission/altitudes.py", "low gotos", (
        (f"{ALTITUDES}.check_altitude", _nothing),)),
}  # fmt: skip


def rule_of(words: str) -> str:
    return next((name for name, rule in RULES.items() if any(one in words for one in rule.words)), "other")


@contextlib.contextmanager
def without(rule: str | None) -> Iterator[None]:
    """Switch a rule off meanwhile."""
    with contextlib.ExitStack() as stack:
        for place, instead in RULES[rule].off if rule else ():
            stack.enter_context(patch(place, instead))
        yield
