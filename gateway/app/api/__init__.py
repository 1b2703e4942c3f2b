"""What other programs may use of this package: frames of both protocols, and a gateway inside a program.

``gateway/__init__.py`` offers these names as its own. Their signatures are kept from one version to the next.
"""

from __future__ import annotations

from gateway.app.api.embedding import RunningGateway, open_gateway
from gateway.app.api.frames import Frame, FrameError, Splitter, decode, decode_reply, encode, encode_reply
from gateway.core.errors import Fault, UserError

__all__ = [
    "Fault",
    "Frame",
    "FrameError",
    "RunningGateway",
    "Splitter",
    "UserError",
    "decode",
    "decode_reply",
    "encode",
    "encode_reply",
    "open_gateway",
]
