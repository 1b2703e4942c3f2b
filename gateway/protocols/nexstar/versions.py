"""Version numbers of hand controls: the command set and the numbers of the tracking modes of each version.

Versions are written as in the manual (``4.21``) or as ``starsense-1.20``; the numbers of a StarSense begin at 1.18,
those of a GT at 100. Each counts as the version whose commands it has: a GT before 104.0 as 1.2 and from then on as
4.03 (NexStar protocol, Get Version), a StarSense as 4.21, because programs that drive a StarSense use neither ``i`` of
5.28 nor ``u`` of 5.29. A SynScan of 3.37 has the commands of 4.37.03; no hand control of Celestron has such a number.
"""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct

from gateway.core.operations import Tracking
from gateway.protocols.wireformat.rows import Model, Version, format_version, parse_version

STARSENSE = "starsense"
STARSENSE_OLDEST, STARSENSE_NEWEST, STARSENSE_END = (1, 18), (1, 20), (2, 0)
STARSENSE_COUNTS_AS: Version = (4, 21)
#: The StarSense version that sends its version after the mode in the reply to ``t``.
STARSENSE_LONG_MODE: Version = (1, 20)
#: Replies to ``v``.
NEXSTAR_VARIANT, STARSENSE_VARIANT = 17, 19
GT_FROM, GT_NEW_FROM = 100, (104, 0)
#: Up to this version the letters of the pier side are swapped in the southern hemisphere.
LETTERS_SWAPPED_UNTIL = (5, 24)
GT_OLD_COUNTS_AS, GT_NEW_COUNTS_AS = (1, 2), (4, 3)
#: The first SynScan versions with sync and pier side, of series 3 and 4 (SynScan protocol, Sync Commands); the version
#: that the former counts as, and the version that earlier ones of series 4 count as.
SYNSCAN_3_FROM, SYNSCAN_4_FROM, SYNSCAN_3_COUNTS_AS, OLD_SYNSCAN_COUNTS_AS = (3, 37), (4, 37, 3), (4, 21), (4, 3)
#: Tracking modes by their code in ``t`` and ``T``; ``SHIFTED_MODES`` on German mounts of a few versions.
MODES = {0: Tracking.OFF, 1: Tracking.ALTAZ, 2: Tracking.EQ_NORTH, 3: Tracking.EQ_SOUTH}
SHIFTED_MODES = {0: Tracking.OFF, 1: Tracking.EQ_NORTH, 2: Tracking.EQ_SOUTH}
#: A SynScan's modes: None is the equatorial mode of the mount's hemisphere; 3 is 2 with periodic error correction.
SYNSCAN_MODES = {0: Tracking.OFF, 1: Tracking.ALTAZ, 2: None, 3: None}


class Release(Struct, frozen=True):
    """A version: the numbers that ``V`` returns, the version whose commands it has, whether it is a StarSense."""

    reported: Version
    counts_as: Version
    starsense: bool = False

    @property
    def text(self) -> str:
        """The version as a user types it."""
        return f"{STARSENSE}-{format_version(self.reported)}" if self.starsense else format_version(self.reported)

    @property
    def variant(self) -> int:
        """The reply to ``v``."""
        return STARSENSE_VARIANT if self.starsense else NEXSTAR_VARIANT


def is_starsense(text: str | None) -> bool:
    """Whether a version string names a StarSense."""
    return text is not None and text.partition("-")[0] == STARSENSE


def parse(text: str) -> Release:
    """Parse ``4.21``, ``104.0``, ``starsense-1.20`` or ``starsense`` (its newest). Raises ValueError."""
    if not is_starsense(text):
        shown = parse_version(text)
        return Release(shown, counts_as(shown))
    _, dash, version = text.partition("-")
    shown = parse_version(version)[:2] if dash else STARSENSE_NEWEST
    if not STARSENSE_OLDEST <= shown < STARSENSE_END:
        raise ValueError(f"a StarSense has versions from {format_version(STARSENSE_OLDEST)} on, not {version}")
    return Release(shown, counts_as(shown, starsense=True), True)


def counts_as(version: Version, *, starsense: bool = False, synscan: bool = False) -> Version:
    """Return the version whose commands a hand control with this version number has."""
    if starsense:
        return STARSENSE_COUNTS_AS
    if SYNSCAN_3_FROM <= version < (4,):
        return SYNSCAN_3_COUNTS_AS
    if synscan and (4,) <= version < SYNSCAN_4_FROM:
        return OLD_SYNSCAN_COUNTS_AS
    if version[0] < GT_FROM:
        return version
    return GT_NEW_COUNTS_AS if version >= GT_NEW_FROM else GT_OLD_COUNTS_AS


def has_shifted_modes(model: Model, version: Version | None) -> bool:
    """Whether this model and version numbers EQ north as 1: CGE and Advanced GT 3.01-3.04 do."""
    first_last = model.get("shifted")
    if not first_last or version is None:
        return False
    return parse_version(first_last[0]) <= version <= parse_version(first_last[1])


def modes_by_code(model: Model, version: Version | None) -> Mapping[int, Tracking | None]:
    """Return code -> tracking mode for this model and version; None is the equatorial mode of the hemisphere."""
    if "dialect" in model:
        return SYNSCAN_MODES
    return SHIFTED_MODES if has_shifted_modes(model, version) else MODES


def mode_code(mode: Tracking, model: Model, version: Version | None) -> int:
    """Return the code of a tracking mode in ``t`` and ``T``; for a mode that this version lacks 1, which tracks."""
    known = modes_by_code(model, version).items()
    return next(
        (code for code, version_mode in known if version_mode is mode or (version_mode is None and mode.equatorial)), 1
    )


def letters_swapped(model: Model, version: Version | None) -> bool:
    """Whether E and W of the pier side are swapped in the southern hemisphere; False for an unknown version."""
    return "dialect" not in model and version is not None and version <= LETTERS_SWAPPED_UNTIL


def versions_of(model: Model) -> list[str]:
    """Return the versions in a row of ``models.toml``, oldest first, then its StarSense if the model can have it."""
    versions = list(model.get("versions", ()))
    return [*versions, Release(STARSENSE_NEWEST, STARSENSE_COUNTS_AS, True).text] if model.get(STARSENSE) else versions
