"""The operations: everything that a client can ask of a mount, as frozen values that can be logged and compared.

A surface yields them and a driver carries them out; neither depends on the other. Angles are degrees, right ascension
included, of the equinox of date unless a surface is set to J2000. Longitudes are positive to the EAST; a UTC offset is
local time minus UTC, in hours. Motion is either on the *sky* (``Move``) or of one *axis* (``MoveAxis``).
"""

from __future__ import annotations

from gateway.core.operations.motions import *
from gateway.core.operations.reads import *
from gateway.core.operations.settings import *
from gateway.core.operations.values import *
from gateway.core.operations.values import Operation, Read


def operation_class(name: str) -> type[Operation] | None:
    """Return the operation class of that name, or None."""
    kind: object = globals().get(name)
    if isinstance(kind, type) and issubclass(kind, Operation) and kind not in (Operation, Read):
        return kind
    return None
