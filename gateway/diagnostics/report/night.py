"""What a report tells of a night, as values. Times are Unix seconds, angles degrees, answer times seconds."""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple


class Site(NamedTuple):
    """Longitude is east positive. ``source`` says who told it."""

    latitude: float
    longitude: float
    source: str


class Pointing(NamedTuple):
    """Where the tube pointed: right ascension and declination as the mount told them."""

    time: float
    ra: float
    dec: float


class Remark(NamedTuple):
    """Something that went wrong, or was refused: to whom, and in words."""

    time: float
    who: str
    words: str


@dataclass
class Program:
    """All connections from one host to one surface."""

    host: str
    surface: str
    first: float
    last: float
    connections: int = 0
    commands: Counter[str] = field(default_factory=Counter)
    refused: int = 0

    @property
    def sent(self) -> int:
        return self.commands.total()

    @property
    def per_minute(self) -> float:
        """Commands a minute, over the time from its first connection to its last command."""
        return self.sent / max((self.last - self.first) / 60.0, 1.0)


@dataclass
class Night:
    """``cut`` is why the recording is less than there was, in words; ``equinox`` is what the mount's places are of."""

    mount: str
    surfaces: list[str]
    began: float
    ended: float = 0.0
    equinox: str = "jnow"
    lowest: float = 0.0
    highest: float = 90.0
    site: Site | None = None
    pointings: list[Pointing] = field(default_factory=list)
    #: When the mount was asked, and how long each answer took; a night has a million of them.
    asked: array[float] = field(default_factory=lambda: array("d"))
    took: array[float] = field(default_factory=lambda: array("d"))
    unanswered: int = 0
    gotos: int = 0
    #: What went wrong on the mount's line, and what the gateway has to say about the mount.
    remarks: list[Remark] = field(default_factory=list)
    refusals: list[Remark] = field(default_factory=list)
    programs: dict[tuple[str, str], Program] = field(default_factory=dict)
    cut: str = ""
