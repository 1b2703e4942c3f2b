"""A mount as the broker is shown it: plain values, made of what is known without asking the mount.

Angles are told as finely as somebody who looks can use, so that a mount that stands is told once and not every second.
"""

from __future__ import annotations

from typing import Any

from gateway.app.control.gather import look
from gateway.app.gateway import Gateway
from gateway.app.status import does
from gateway.core import operations as op


def state(gateway: Gateway) -> dict[str, Any]:
    """What is not known is None."""
    controller = gateway.controller
    assert controller is not None
    seen = look(controller, gateway.config.name or "", str(gateway.mount), len(gateway.programs()))
    identity: op.Identity | None = controller.cache.value(op.GetIdentity)
    status = seen.status
    return {
        "online": seen.state in ("up", "busy"),
        "does": does(seen) or seen.state,
        **_places(gateway, seen.position),
        "tracking": None if status is None else status.tracking is not op.Tracking.OFF,
        "moving": seen.slewing or seen.by_hand,
        "aligned": None if status is None else status.aligned,
        "asleep": seen.asleep,
        "held": seen.held,
        "product": identity.product if identity else None,
        "model": identity.model if identity else None,
        "version": identity.version if identity else None,
        "line": {"state": seen.state, "reason": seen.reason, "answer_seconds": round(controller.line.typical, 2)},
        "programs": seen.programs,
    }


def _places(gateway: Gateway, seen: op.Equatorial | None) -> dict[str, float | None]:
    assert gateway.controller is not None
    derived = gateway.controller.astrometry
    over = None if seen is None or derived.site_clock.site() is None else derived.horizon(seen)
    return {
        "ra_hours": None if seen is None else round(seen.ra / 15.0, 5),
        "dec_degrees": None if seen is None else round(seen.dec, 4),
        "altitude_degrees": None if over is None else round(over.alt, 2),
        "azimuth_degrees": None if over is None else round(over.az, 2),
    }
