"""An object's catalogue entry, its visual quality, and the location of the catalogues' data files.

Kinds are the letters of the Meade protocol's type string: G galaxy, P planetary nebula, D diffuse nebula, C globular
cluster, O open cluster; a cluster with nebulosity is both D and O; ``*`` is a star. The catalogues do not rate how well
an object can be seen, so the quality is estimated here: by its magnitude, and one step lower if its surface brightness
is fainter than magnitude 14 per square arcminute. Data files are found without importing their packages.
"""

from __future__ import annotations

import math
from importlib.util import find_spec
from pathlib import Path

from msgspec import Struct

from gateway.core.errors import Unsupported

#: Qualities of the Meade protocol, best first: super, excellent, very good, good, fair, poor, very poor.
QUALITIES = ("SU", "EX", "VG", "GD", "FR", "PR", "VP")
#: The faintest magnitude of each quality except the last.
MAG_LIMITS = (5.0, 7.0, 9.0, 11.0, 12.5, 14.0)
_FAINT_SURFACE_BRIGHTNESS = 14.0
_KIND_WORDS = {"G": "GAL", "P": "PLAN NEB", "D": "DIFF NEB", "C": "GLOB CLUS", "O": "OPEN CLUS", "*": "STAR"}


class NotInstalled(Unsupported):
    """The catalogue's package, or its data file, is missing."""

    default_text = "Object library not installed."


def data_file(package: str, name: str) -> Path:
    """Return the path of a data file of an installed package. Raises NotInstalled."""
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        raise NotInstalled
    path = Path(spec.origin).parent / name
    if not path.is_file():
        raise NotInstalled
    return path


class CatalogObject(Struct, frozen=True):
    """An object: J2000 position in degrees; ``size`` (length) and ``width`` in arcminutes; None: not measured."""

    name: str
    kinds: str  # kind letters
    ra: float
    dec: float
    magnitude: float | None = None
    size: float | None = None
    width: float | None = None
    also: str = ""  # other catalogue numbers and names, separated by commas


class SearchLimits(Struct, frozen=True):
    """The limits of a search: magnitudes, sizes in arcminutes, kind letters, and the worst quality."""

    min_mag: float
    max_mag: float
    min_size: float  # arcminutes
    max_size: float
    kinds: str
    quality: str


def quality(magnitude: float | None, size: float | None, width: float | None) -> str:
    """Return one of ``QUALITIES``; very poor without a magnitude. ``size`` and ``width`` in arcminutes."""
    if magnitude is None:
        return QUALITIES[-1]
    step = sum(magnitude > limit for limit in MAG_LIMITS)
    area = math.pi / 4.0 * (size or 0.0) * (width or size or 0.0)
    if area > 1.0 and magnitude + 2.5 * math.log10(area) > _FAINT_SURFACE_BRIGHTNESS:
        step += 1
    return QUALITIES[min(step, len(QUALITIES) - 1)]


def describe(entry: CatalogObject) -> str:
    """Describe an object in the form of the Meade manual: ``M31 EX GAL MAG 3.5 SZ178.0'``; omit unknown values."""
    parts = [entry.name]
    star = entry.kinds == "*"
    if not star:
        parts.append(quality(entry.magnitude, entry.size, entry.width))
    parts.append(_KIND_WORDS.get(entry.kinds[:1], "OBJECT"))
    if entry.magnitude is not None:
        parts.append(f"MAG{entry.magnitude:4.1f}")
    if entry.size is not None:
        parts.append(f"SZ{entry.size:5.1f}'")
    return " ".join(parts)
