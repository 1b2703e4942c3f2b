"""What a hand control's number stands for, and how one of that number counts its tracking modes.

Written as the manual writes it (``4.21``), or ``starsense-1.20``: a StarSense counts anew from 1.18, a GT from 100.
Each counts as the version whose commands it has: a GT before 104.0 as 1.2 and from then on as 4.03 (NexStar protocol,
Get Version), a StarSense as 4.21, for programs that drive one ask it neither ``i`` of 5.28 nor ``u`` of 5.29.
"""

from __future__ import annotations

from msgspec import Struct

from gateway.core.operations import Tracking
from gateway.protocols.wireformat.rows import Model, Version, parse_version, show_version

STARSENSE = "starsense"
STARSENSE_OLDEST, STARSENSE_NEWEST, STARSENSE_END = (1, 18), (1, 20), (2, 0)
STARSENSE_COUNTS_AS: Version = (4, 21)
#: The one that tells its version behind the mode of ``t``.
STARSENSE_LONG_MODE: Version = (1, 20)
#: What ``v`` answers.
NEXSTAR_VARIANT, STARSENSE_VARIANT = 17, 19
GT_FIRST, GT_SECOND = 100, (104, 0)
GT_OLD, GT_NEW = (1, 2), (4, 3)
#: The tracking modes as ``t`` and ``T`` count them; and on German mounts of a few versions, which have no alt-az mode.
MODES = {0: Tracking.OFF, 1: Tracking.ALTAZ, 2: Tracking.EQ_NORTH, 3: Tracking.EQ_SOUTH}
SHIFTED_MODES = {0: Tracking.OFF, 1: Tracking.EQ_NORTH, 2: Tracking.EQ_SOUTH}


class Number(Struct, frozen=True):
    """A hand control's number: what ``V`` tells, the version whose commands it has, and whether it is a StarSense."""

    shown: Version
    counts_as: Version
    starsense: bool = False

    @property
    def written(self) -> str:
        """As a person types it."""
        return f"{STARSENSE}-{show_version(self.shown)}" if self.starsense else show_version(self.shown)

    @property
    def variant(self) -> int:
        """What ``v`` answers."""
        return STARSENSE_VARIANT if self.starsense else NEXSTAR_VARIANT


def is_starsense(text: str | None) -> bool:
    """Whether a version is written as one of a StarSense."""
    return text is not None and text.partition("-")[0] == STARSENSE


def numbered(text: str) -> Number:
    """``4.21``, ``104.0``, ``starsense-1.20``, ``starsense`` (its newest). Raises ValueError."""
    if not is_starsense(text):
        shown = parse_version(text)
        return Number(shown, counts_as(shown))
    _, dash, version = text.partition("-")
    shown = parse_version(version)[:2] if dash else STARSENSE_NEWEST
    if not STARSENSE_OLDEST <= shown < STARSENSE_END:
        raise ValueError(f"a StarSense has versions from {show_version(STARSENSE_OLDEST)} on, not {version}")
    return Number(shown, counts_as(shown, starsense=True), True)


def counts_as(shown: Version, *, starsense: bool = False) -> Version:
    """The version whose commands a hand control of that number has."""
    if starsense:
        return STARSENSE_COUNTS_AS
    if shown[0] < GT_FIRST:
        return shown
    return GT_NEW if shown >= GT_SECOND else GT_OLD


def shifted(row: Model, version: Version | None) -> bool:
    """Whether this model and version counts EQ north as 1: CGE and Advanced GT 3.01-3.04 do."""
    first_last = row.get("shifted")
    if not first_last or version is None:
        return False
    return parse_version(first_last[0]) <= version <= parse_version(first_last[1])


def modes(row: Model, version: Version | None) -> dict[int, Tracking]:
    """Code -> tracking mode, as this model and version counts them."""
    return SHIFTED_MODES if shifted(row, version) else MODES


def code_of(mode: Tracking, row: Model, version: Version | None) -> int:
    """The other way round; 1, which tracks, for a mode that it does not have."""
    return next((code for code, known in modes(row, version).items() if known is mode), 1)


def made_with(row: Model) -> list[str]:
    """The versions of a row of ``models.toml``, oldest first, then the StarSense that may take their place."""
    versions = list(row.get("versions", ()))
    return [*versions, Number(STARSENSE_NEWEST, STARSENSE_COUNTS_AS, True).written] if row.get(STARSENSE) else versions
