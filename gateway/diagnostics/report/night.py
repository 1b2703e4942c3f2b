"""The data of a report on a recorded night. Times are Unix seconds, angles degrees, reply times seconds."""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple


class SiteOfNight(NamedTuple):
    """The observing site; longitude is positive east. ``source`` says where it comes from: mount or settings."""

    latitude: float
    longitude: float
    source: str


class Pointing(NamedTuple):
    """A position of the tube: right ascension and declination as the mount reported them."""

    time: float
    ra: float
    dec: float


class Incident(NamedTuple):
    """A problem or a refusal: when, which client (or the mount) it concerned, and a description."""

    time: float
    client_name: str
    text: str


@dataclass
class ProgramConnections:
    """All connections from one host to one surface."""

    host: str
    surface: str
    first_time: float
    last_time: float
    connection_count: int = 0
    commands: Counter[str] = field(default_factory=Counter)
    refusal_count: int = 0

    @property
    def command_count(self) -> int:
        return self.commands.total()


@dataclass
class Night:
    """The content of a recording. ``equinox``: of the positions; ``cut_reason``: why the recording is incomplete."""

    mount: str
    surfaces: list[str]
    began: float
    ended: float = 0.0
    equinox: str = "jnow"
    lowest_alt: float = 0.0
    highest_alt: float = 90.0
    site: SiteOfNight | None = None
    pointings: list[Pointing] = field(default_factory=list)
    #: When each query was sent to the mount, and how long its reply took; a night has a million of them.
    request_times: array[float] = field(default_factory=lambda: array("d"))
    reply_times: array[float] = field(default_factory=lambda: array("d"))
    unanswered_count: int = 0
    goto_count: int = 0
    #: Problems of the connection with the mount, and the gateway's notes about the mount.
    remarks: list[Incident] = field(default_factory=list)
    refusals: list[Incident] = field(default_factory=list)
    programs: dict[tuple[str, str], ProgramConnections] = field(default_factory=dict)
    cut_reason: str = ""
    #: The version of the gateway that made the recording, with its commit.
    recorded_by: str = ""
