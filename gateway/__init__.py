"""mount-gateway: translates between the protocols of Meade LX200, Celestron NexStar and ASCOM Alpaca mounts.

The public names are listed in ``__all__`` and explained in docs/python.md; everything else may change with every
version. They are loaded on first use, because the command line does not need them and must start quickly. This module
is above all layers: nothing inside the package imports it.
"""

from __future__ import annotations

#: Type checkers and editors assume that this is true. Importing ``typing`` for its constant would take time.
TYPE_CHECKING = False

__all__ = [
    "BelowHorizon",
    "BlockingMount",
    "Entry",
    "Fault",
    "Frame",
    "FrameError",
    "Held",
    "Invalid",
    "Moment",
    "Mount",
    "NearSun",
    "NoAnswer",
    "Place",
    "Refused",
    "Splitter",
    "State",
    "Stopped",
    "SyncTooFar",
    "TooHigh",
    "Unsupported",
    "UserError",
    "WayBlocked",
    "connect",
    "connect_blocking",
    "decode",
    "decode_reply",
    "encode",
    "encode_reply",
    "op",
    "open_blocking_gateway",
    "open_gateway",
]

if TYPE_CHECKING:
    __version__: str
    from gateway.app.api.blocking import BlockingMount, connect_blocking, open_blocking_gateway
    from gateway.app.api.frames import Frame, FrameError, Splitter, decode, decode_reply, encode, encode_reply
    from gateway.app.api.mount import Mount
    from gateway.app.api.opening import connect, open_gateway
    from gateway.app.status import State
    from gateway.core import operations as op
    from gateway.core.errors import (
        BelowHorizon,
        Fault,
        Held,
        Invalid,
        NearSun,
        NoAnswer,
        Refused,
        Stopped,
        SyncTooFar,
        TooHigh,
        Unsupported,
        UserError,
        WayBlocked,
    )
    from gateway.core.operations import Moment, Place
    from gateway.core.wire_log import Entry


def __getattr__(name: str) -> object:
    if name == "__version__":
        from gateway.core.about import version

        return version()
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gateway.app.api import blocking, frames, mount, opening
    from gateway.app.status import State
    from gateway.core import errors, operations, wire_log

    if name in ("op", "State"):
        return operations if name == "op" else State
    modules = (mount, opening, blocking, frames, errors, operations, wire_log)
    return next(getattr(module, name) for module in modules if hasattr(module, name))
