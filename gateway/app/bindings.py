"""From what the user has set to what the protocols are given: drivers for mounts, surfaces for ports."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.clients.acceptor import SurfaceBinding
from gateway.core.errors import UserError
from gateway.mount.safety.limits import Limits
from gateway.protocols.base.frames import Framing
from gateway.protocols.base.plain_replies import PlainReplies
from gateway.protocols.base.reply_rules import Replies
from gateway.protocols.base.spec import DriverSettings, MadeDriver, SurfaceSettings
from gateway.protocols.registry import PROTOCOLS, mounts, surfaces

Cutting = Callable[[Callable[[], float]], Framing]


def check_pair(mount: Endpoint, endpoints: Sequence[Endpoint]) -> None:
    """Raises UserError where the protocol of the mount has no driver, or that of a surface no surface."""
    if mount.protocol not in mounts():
        raise UserError(f"{mount}: {mount.protocol} mounts cannot be driven; {' or '.join(mounts())} can")
    for endpoint in endpoints:
        if endpoint.protocol not in surfaces():
            raise UserError(f"{endpoint}: no {endpoint.protocol} surface; write {' or '.join(surfaces())}")


def make_driver(endpoint: Endpoint, config: MountConfig, now: Callable[[], float]) -> MadeDriver:
    """The driver of a mount. Raises UserError where its protocol has none."""
    make = PROTOCOLS[endpoint.protocol].make_driver
    if make is None:
        raise UserError(f"{endpoint.protocol} mounts cannot be driven; {' or '.join(mounts())} can")
    settings = DriverSettings(
        model=endpoint.model,
        version=endpoint.version,
        site=config.site,
        mode=config.mode,
        guide_rate=config.guide_rate,
        guide_directions=config.guide_directions,
        park=config.park if isinstance(config.park, tuple) else None,
        aux_home=config.aux_home,
        lowest=config.lowest,
    )
    return make(settings, now)


def make_surface(endpoint: Endpoint, config: SurfaceConfig, limits: Limits) -> SurfaceBinding:
    """The surface for a port. Raises UserError where its protocol has none."""
    spec = PROTOCOLS[endpoint.protocol]
    if spec.make_surface is None:
        raise UserError(f"no {endpoint.protocol} surface; write {' or '.join(surfaces())}")
    made = spec.make_surface(
        SurfaceSettings(endpoint.model, endpoint.version, config.precision, config.sync_text, limits)
    )
    return SurfaceBinding(
        spec.title,
        made.surface,
        spec.framing,
        spec.opening,
        made.model,
        made.settings,
        counts_in=spec.equinox,
        fit=made.fit,
    )


def speech(protocol: str) -> tuple[Cutting, Replies]:
    """How a protocol's commands are cut out of bytes, and how its replies are taken apart."""
    spec = PROTOCOLS[protocol]
    return spec.framing, PlainReplies(spec.commands) if spec.reply_rules is None else spec.reply_rules()
