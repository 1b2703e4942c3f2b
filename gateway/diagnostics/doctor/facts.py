"""The facts about this computer, before the checks judge them, and the result of a check.

None means that this system does not say. Times are Unix seconds.
"""

from __future__ import annotations

from typing import Final, Literal

from msgspec import Struct

#: Good; worth knowing, but no failure; must be fixed before a gateway can work as it should.
GOOD: Final = "good"
NOTE: Final = "note"
BAD: Final = "bad"
State = Literal["good", "note", "bad"]
#: What a check yields: the state, what was found, and what to do about it.
Said = tuple[State, str, str]


class CheckResult(Struct, frozen=True):
    """One line of the report: the check, its state, what was found, and what to do about it."""

    check: str
    state: State
    found: str
    do: str = ""


class Package(Struct, frozen=True):
    """A required package: the versions that are suitable, and the installed version, empty if there is none."""

    name: str
    needed: str
    version: str
    fits: bool = True


class Port(Struct, frozen=True):
    """A serial port. Members of ``group`` may use it; the program ``holder`` has it open."""

    name: str
    about: str = ""
    usb: bool = True
    permitted: bool = True
    group: str = "dialout"
    holder: str = ""
    modem_manager_ignores: bool = False


class Running(Struct, frozen=True):
    """A running gateway and its mount; ``mount`` is empty if the gateway does not answer this user.

    ``foreign``: another user's. ``served``: its present addresses for programs; ``folder``: its state folder.
    """

    process: int
    mount: str = ""
    user: str = ""
    foreign: bool = False
    served: tuple[str, ...] = ()
    folder: str = ""
    #: What its sky is calculated from.
    sky: str = ""


class Facts(Struct, frozen=True):
    """One computer at one moment."""

    version: str
    python: tuple[int, int, int]
    system: str
    now: float
    #: When the astronomy data were published.
    published: float | None
    #: When the days end that the almanac has from today on; None if it does not have today.
    almanac_until: float | None
    packages: list[Package]
    #: The missing packages of each extra that is not installed completely.
    missing_extras: dict[str, list[str]]
    ports: list[Port]
    #: The groups of this user, and those of this login session: a new group takes effect at the next login.
    groups: set[str]
    active_groups: set[str]
    clock_synchronized: bool | None
    #: Running programs that are known to disturb serial ports, with their process ids.
    meddlers: dict[str, int]
    state_folder: str
    state_problem: str
    gateways: list[Running]
    #: The pip command of this environment, for the user to type.
    pip: str = "pip"

    @property
    def without_astropy(self) -> bool:
        """Whether astropy was left out, which is permitted: an almanac from another computer takes its place."""
        return any(package.name == "astropy" and not package.version for package in self.packages)
