"""What is known of this computer before anything is judged, and what a judgement is.

None stands for what this system does not tell. Times are Unix seconds.
"""

from __future__ import annotations

from typing import Final, Literal

from msgspec import Struct

#: All is well; worth knowing, and no reason to fail; to be mended before a gateway can work as it should.
GOOD: Final = "good"
NOTE: Final = "note"
BAD: Final = "bad"
State = Literal["good", "note", "bad"]
#: What a check says: how it is, what was found, and what to do about it.
Said = tuple[State, str, str]


class Result(Struct, frozen=True):
    """One line: what was looked at, how it is, and what to do about it."""

    check: str
    state: State
    found: str
    do: str = ""


class Package(Struct, frozen=True):
    """Something that mount-gateway needs: the versions that will do, and the one that is here, empty where none is."""

    name: str
    needed: str
    version: str
    fits: bool = True


class Port(Struct, frozen=True):
    """A serial port. ``group`` may use it; ``holder`` has it open; ``modem_manager_ignores`` it by a udev rule."""

    name: str
    about: str = ""
    usb: bool = True
    permitted: bool = True
    group: str = "dialout"
    holder: str = ""
    modem_manager_ignores: bool = False


class Listener(Struct, frozen=True):
    """Who listens on a TCP port; ``process`` is 0 where that is hidden from this user."""

    port: int
    process: int = 0
    name: str = ""


class Running(Struct, frozen=True):
    """A gateway that runs, and the mount that it serves; without one it cannot be asked from here.

    ``foreign`` is one of another user than this one.
    """

    process: int
    mount: str = ""
    user: str = ""
    foreign: bool = False


class Facts(Struct, frozen=True):
    """One computer at one moment."""

    version: str
    python: tuple[int, int, int]
    system: str
    now: float
    #: When the astronomy data were published, and the last moments for which they know UT1 and the leap seconds.
    published: float | None
    rotation_until: float | None
    leap_seconds_until: float | None
    packages: list[Package]
    #: The catalogues and the other extras that are missing, by the name of the extra.
    missing_extras: dict[str, list[str]]
    ports: list[Port]
    #: Groups that this user was put into, and those that this session knows of: a new one counts from the next login.
    groups: set[str]
    active_groups: set[str]
    clock_synchronized: bool | None
    #: Programs that are known to disturb serial ports, with the number of the process.
    meddlers: dict[str, int]
    listeners: list[Listener]
    state_folder: str
    state_problem: str
    gateways: list[Running]
    #: How a person has packages of this environment installed: the beginning of a command.
    pip: str = "pip"
