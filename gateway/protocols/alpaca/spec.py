"""The ``ProtocolSpec`` of ASCOM Alpaca. It has a surface for programs and a driver for Alpaca servers."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gateway.protocols.base.spec import DriverSettings, MadeDriver, MadeSurface, ProtocolSpec, SurfaceSettings, lazy
from gateway.protocols.wireformat.command_set import functions_of, load, surface_functions

if TYPE_CHECKING:
    from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca
    from gateway.protocols.base.driver import FollowUps

NAME, DEFAULT_MODEL = "alpaca", "german"


def _make_surface(settings: SurfaceSettings) -> MadeSurface:
    from gateway.protocols.alpaca.surface import abilities, device, motion, site
    from gateway.protocols.alpaca.surface.client import AlpacaSurface
    from gateway.protocols.base.session import ClientSettings

    protocol, model = load(NAME), {"name": NAME, "equinox": settings.equinox}
    surface = AlpacaSurface(protocol, surface_functions(abilities, device, motion, site))
    return MadeSurface(surface, model, ClientSettings(settings.limits))


def _make_simulator(model: str | None, version: str | None, **settings: Any) -> SimulatedAlpaca:
    from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca

    return SimulatedAlpaca(model or DEFAULT_MODEL, **settings)


def _make_driver(settings: DriverSettings, now: Callable[[], float]) -> MadeDriver:
    from gateway.protocols.alpaca.driver import contradictions, identify, motion, place, pointing
    from gateway.protocols.alpaca.driver.reply_rules import AlpacaReplyRules
    from gateway.protocols.alpaca.driver.state import AlpacaDriver

    handlers = functions_of(identify, motion, place, pointing)
    driver = AlpacaDriver(now, settings, handlers)
    follow_ups: FollowUps = {
        pointing.KeepTracking: pointing.keep_tracking,
        motion.ContinuePulses: motion.continue_pulses,
        contradictions.CompareEquinox: contradictions.compare_equinox,
    }
    return MadeDriver(driver, follow_ups, AlpacaReplyRules())


def _hint(frame: bytes) -> str:
    """Explain how requests are written, in the message about an unknown request."""
    if load(NAME).find(frame + b"\n") is not None:
        return "a request ends with a line feed: append \\x0a"
    return "requests are written like 'get rightascension\\x0a' and 'put tracking Tracking=true\\x0a'"


SPEC = ProtocolSpec(
    name=NAME,
    has_alignment=False,
    title="ASCOM Alpaca",
    program_phrase="an ASCOM Alpaca",
    mount_phrase="a mount with ASCOM Alpaca",
    menu_entry="ASCOM Alpaca",
    mounts_phrase="ASCOM Alpaca telescope",
    default_model=DEFAULT_MODEL,
    usual_port=11111,
    guides_by="sky",
    new_framer=lazy("alpaca.http.requests", "LineFramer"),
    opening_pattern=rb"(?:(?:get|put) [^\n]*\n)*",
    make_surface=_make_surface,
    make_simulator=_make_simulator,
    find_mounts=lazy("alpaca.http.finding", "find"),
    web=lazy("alpaca.http.discovery", "AlpacaWeb"),
    reply_rules=lazy("alpaca.driver.reply_rules", "AlpacaReplyRules"),
    make_driver=_make_driver,
    make_http_dialect=lazy("alpaca.driver.telescope_http", "TelescopeHttp"),
    park_is_stored=True,
    slowest_mount="a server with a mount on a slow line",
    required_requests=("put connected Connected=true\\x0a",),
    hint=_hint,
    likelihood=lambda sent: 1.0 if re.match(rb"(?:get|put) [a-z]+[ \n]", sent) else 0.0,
)
