"""The state of a mount for pages as plain dictionaries, from cached readings: the mount is not asked.

Angles are degrees, azimuth from north through east, times Unix seconds. Texts are those of the command ``status``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gateway.app.gateway import Gateway
from gateway.app.mount_state import MountState
from gateway.app.status import activity
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.mount.controller import MountController
from gateway.mount.motion.wanted import Slew
from gateway.mount.safety.admission.contradictions import is_time_unknown, site_text

#: Decimal places of degrees: 0.04 arcseconds for positions, 0.001 degrees for azimuth and altitude; the rest is noise.
FINE_DECIMALS, COARSE_DECIMALS = 5, 3
#: The operations that the page offers only if the mount supports them.
OPTIONAL_OPERATIONS = ("Goto", "Home", "Move", "Park", "Pulse", "SetGuideRate", "SetTracking", "Sync", "TrackRate")
#: Advice for a terminal, which is removed for a page, because a page has a button instead.
RELEASE_ADVICE = " (mount-gateway stop --release)"
#: The bodies of the solar system that are shown.
BODIES = ("Sun", "Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")


def state(gateway: Gateway, index: int) -> dict[str, Any]:
    """Return the state of a mount without the parts that ``ShownMount`` caches. Takes about 0.1 ms."""
    controller, state = gateway.controller, gateway.state()
    shown, look, status, limits = state.to_state(), state.look, state.look.status, state.policy.limits
    position = None if look.position is None else coordinates(controller, look.position, state.horizontal)
    return {
        "index": index, "name": look.name, "at": state.mount, "found": shown.identity_text, "product": shown.product,
        "model": shown.model, "version": shown.version, "state": look.state, "reason": look.reason,
        "does": activity(look), "pier": state.pier_side, "tracking": status.tracking.value if status else "",
        "tracks": status is not None and status.tracking is not op.Tracking.OFF,
        "aligned": status.aligned if status else None, "equatorial": status.equatorial if status else None,
        "german": state.german, "slewing": look.slewing, "by_hand": look.by_hand, "moves": look.moves,
        "asleep": look.asleep, "parked": activity(look).endswith("parked"), "held": look.held,
        "goto_unparks": controller.driver.goto_unparks, "wanted": list(shown.wanted),
        "allowed": [in_page_wording(text) for text in shown.allowed],
        "lately": [in_page_wording(text) for text in shown.lately],
        "line": {"typical": round(state.reply_time, 3), "answers": state.reply_count},
        "surfaces": gateway.names(),
        "limits": {key: getattr(limits, key) for key in ("lowest", "highest", "sun", "hour_angle", "by_page")},
        "own_limits": str(controller.owners_limits), "position": position and {**position, "age": round(look.age, 1)},
        "site_holds": controller.site_settings.site_users(),
        **_sidereal_and_hour_angle(controller, state), **_site_and_clock(state), **_goto_target(controller, state),
    }  # fmt: skip


def in_page_wording(text: str) -> str:
    """Return a text without ``RELEASE_ADVICE``, which is for users of a terminal."""
    return text.replace(RELEASE_ADVICE, "")


def abilities(controller: MountController) -> dict[str, Any]:
    """Return which functions of the page the mount supports, its guide rates, its speeds for the keys 1 to 9, and its
    park position; each is None while unknown.
    """
    status = controller.cache.last_or_forgotten(op.GetStatus)
    if not controller.identified.is_set() or status is None:
        return {"can": None, "guides": None, "speeds": None, "park": None}
    able = controller.driver.abilities(status.equatorial)
    return {
        "can": [name for name in OPTIONAL_OPERATIONS if name in able.can],
        "guides": [round(rate, 3) for rate in able.guides],
        "speeds": [round(controller.driver.speed(op.Rate(key=key)), 4) for key in range(1, 10)],
        "park": _park_position(controller, status),
    }  # fmt: skip


def _park_position(controller: MountController, status: op.Status) -> dict[str, float] | None:
    """Return the park position; None if only the mount knows it, or if the site is unknown."""
    axes, derived = controller.driver.destination(op.Park()), controller.astrometry
    if axes is None or (status.equatorial and derived.site_clock.site() is None):
        return None
    horizontal: op.GotoAxes | op.Horizontal = axes
    if status.equatorial:
        horizontal = derived.horizontal(derived.from_axes(axes, on_wedge=not controller.driver.german))
    return {"alt": round(horizontal.alt, COARSE_DECIMALS), "az": round(horizontal.az, COARSE_DECIMALS)}


def coordinates(
    controller: MountController, position: op.Equatorial, horizontal: op.Horizontal | None = None
) -> dict[str, Any]:
    """Return a position of date in degrees, also as J2000 and as altitude and azimuth (None if the site is unknown)."""
    derived = controller.astrometry
    ra2000, dec2000 = derived.sky.to_j2000(position.ra, position.dec, derived.site_clock.unix())
    shown: dict[str, Any] = {
        "ra": round(position.ra, FINE_DECIMALS), "dec": round(position.dec, FINE_DECIMALS),
        "ra2000": round(ra2000, FINE_DECIMALS), "dec2000": round(dec2000, FINE_DECIMALS), "alt": None, "az": None,
    }  # fmt: skip
    if horizontal is None and derived.site_clock.site() is not None:
        horizontal = derived.horizontal(position)
    if horizontal is not None:
        shown |= {"alt": round(horizontal.alt, COARSE_DECIMALS), "az": round(horizontal.az, COARSE_DECIMALS)}
    return shown


def bodies(controller: MountController) -> Iterator[dict[str, Any]]:
    """Yield the bodies with known positions: name, J2000 position, altitude and azimuth (None without a site)."""
    for name in BODIES:
        where = _body_position(controller, name)
        if where is not None:
            place = coordinates(controller, where)
            yield {"name": name, **{key: place[key] for key in ("ra2000", "dec2000", "alt", "az")}}


def _body_position(controller: MountController, body_name: str) -> op.Equatorial | None:
    derived = controller.astrometry
    unix = derived.site_clock.unix()
    if body_name == "Sun":
        return op.Equatorial(*derived.sky.sun(unix))
    if body_name == "Moon":
        site = derived.site_clock.site()
        return None if site is None else op.Equatorial(*derived.sky.moon(unix, site.latitude, site.longitude)[:2])
    planet = derived.sky.planet(body_name, unix)
    return None if planet is None else op.Equatorial(*planet)


def _sidereal_and_hour_angle(controller: MountController, state: MountState) -> dict[str, Any]:
    """Return sidereal time and hour angle, degrees; each is None while it is unknown."""
    if not state.sites:
        return {"sidereal": None, "hour_angle": None}
    sidereal, position = controller.astrometry.sidereal_time(), state.look.position
    angle = None if position is None else round(wrap180(sidereal - position.ra), COARSE_DECIMALS)
    return {"sidereal": round(sidereal, COARSE_DECIMALS), "hour_angle": angle}


def _goto_target(controller: MountController, state: MountState) -> dict[str, Any]:
    """Return ``target``, the target of the goto under way; None without one, and if only its axis angles are known."""
    goal: dict[str, Any] | None = None
    if isinstance(state.goal, op.Equatorial):
        goal = {**coordinates(controller, state.goal), "words": state.goal_text}
    elif isinstance(state.wanted.motion, Slew) and isinstance(state.wanted.motion.operation, op.GotoHorizontal):
        assert state.goal is not None
        goal = {"ra": None, "dec": None, "alt": state.goal.alt, "az": state.goal.az, "words": state.goal_text}
    return {"target": goal}


def _site_and_clock(state: MountState) -> dict[str, Any]:
    """Return the site and the clock that the gateway uses, their sources, and contradictions between sources."""
    time = state.times[0]
    site = None
    if state.sites:
        place, source, _ = state.sites[0]
        site = {"latitude": place.latitude, "longitude": place.longitude, "source": source, "words": site_text(place)}
    return {
        "site": site,
        "clock": {"ahead": round(time.unix - state.unix_time, 1), "source": time.source},
        "site_doubt": next((doubt.warning_line for doubt in state.site_contradictions), ""),
        "clock_doubt": "no source reports the time, and this computer's clock is wrong"
        if is_time_unknown(time)
        else next((doubt.warning_line for doubt in state.clock_contradictions), ""),
    }
