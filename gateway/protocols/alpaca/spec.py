"""The specification of ASCOM Alpaca for the registry: programs speak it, and servers with a telescope behind them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from gateway.protocols.base.spec import (
    DriverSettings,
    MadeDriver,
    MadeSurface,
    OfferedMount,
    ProtocolSpec,
    SurfaceSettings,
)
from gateway.protocols.wireformat.command_set import load

if TYPE_CHECKING:
    from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca
    from gateway.protocols.base.driver import FollowUps
    from gateway.protocols.base.frames import Framer
    from gateway.protocols.base.reply_rules import ReplyRules
    from gateway.transport.http_wire import Dialect
    from gateway.transport.web_port import Web

NAME, DEFAULT_MODEL = "alpaca", "german"


def _framing() -> Framer:
    from gateway.protocols.alpaca.http.requests import LineFramer

    return LineFramer()


def _make_surface(settings: SurfaceSettings) -> MadeSurface:
    from gateway.protocols.alpaca.surface import abilities, device, motion, site
    from gateway.protocols.alpaca.surface.client import AlpacaSurface
    from gateway.protocols.base.session import ClientSettings

    protocol, model = load(NAME), {"name": NAME, "equinox": settings.equinox}
    surface = AlpacaSurface(protocol, protocol.functions("surface", abilities, device, motion, site))
    return MadeSurface(surface, model, ClientSettings(settings.limits))


def _make_simulator(model: str | None, version: str | None, **settings: Any) -> SimulatedAlpaca:
    from gateway.protocols.alpaca.simulator.server import SimulatedAlpaca

    return SimulatedAlpaca(model or DEFAULT_MODEL, **settings)


async def _find_mounts(urls: Sequence[str] | None) -> list[OfferedMount]:
    from gateway.protocols.alpaca.http.finding import find

    return await find(urls)


def _reply_rules() -> ReplyRules:
    from gateway.protocols.alpaca.driver.reply_rules import AlpacaReplyRules

    return AlpacaReplyRules()


def _make_driver(settings: DriverSettings, now: Callable[[], float]) -> MadeDriver:
    from gateway.protocols.alpaca.driver import contradictions, identify, motion, place, pointing
    from gateway.protocols.alpaca.driver.state import AlpacaDriver

    handlers = load(NAME).functions("driver", identify, motion, place, pointing)
    driver = AlpacaDriver(now, settings, handlers)
    follow_ups: FollowUps = {
        motion.KeepTracking: motion.keep_tracking,
        contradictions.CompareEquinox: contradictions.compare_equinox,
    }
    return MadeDriver(driver, follow_ups, _reply_rules())


def _over_http(url: str) -> Dialect:
    from gateway.protocols.alpaca.driver.telescope_http import TelescopeHttp

    return TelescopeHttp(url)


def _hint(frame: bytes) -> str:
    """Explain how requests are written, for one that does not exist."""
    if load(NAME).find(frame + b"\n") is not None:
        return "a request ends with a line feed: append \\x0a"
    return "requests are written like 'get rightascension\\x0a' and 'put tracking Tracking=true\\x0a'"


def _web() -> Web:
    from gateway.protocols.alpaca.http.face import AlpacaWeb

    return AlpacaWeb()


SPEC = ProtocolSpec(
    name=NAME,
    title="ASCOM Alpaca",
    a_program="an ASCOM Alpaca",
    a_mount="a mount with ASCOM Alpaca",
    preset="ASCOM Alpaca",
    mounts="ASCOM Alpaca telescope",
    default_model=DEFAULT_MODEL,
    example="altaz",
    usual_port=11111,
    guide_directions="sky",
    framing=_framing,
    opening=rb"(?:(?:get|put) [^\n]*\n)*",
    make_surface=_make_surface,
    make_simulator=_make_simulator,
    find_mounts=_find_mounts,
    web=_web,
    reply_rules=_reply_rules,
    make_driver=_make_driver,
    over_http=_over_http,
    parks_itself=True,
    slowest="a server with a mount on a slow line",
    required_requests=("put connected Connected=true\\x0a",),
    hint=_hint,
    recognises=lambda sent: 1.0 if re.match(rb"(?:get|put) [a-z]+[ \n]", sent) else 0.0,
)
