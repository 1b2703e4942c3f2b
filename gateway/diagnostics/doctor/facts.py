"""The facts about this computer, which the checks of ``doctor`` judge, and the result of a check.

None means that this system does not provide the value. Times are Unix seconds.
"""

from __future__ import annotations

from typing import Final, Literal

from msgspec import Struct

#: States of a check. A note is worth knowing, but no failure; what is bad must be fixed before a gateway can work.
GOOD: Final = "good"
NOTE: Final = "note"
BAD: Final = "bad"
State = Literal["good", "note", "bad"]  # of a check
#: What a check yields: the state, a description of what was found, and advice (or an empty text).
Said = tuple[State, str, str]


class CheckResult(Struct, frozen=True):
    """One line of the report: name of the check, its state, a description of what was found, and advice."""

    check: str
    state: State
    found: str  # a description of what the check has found
    do: str = ""  # advice


class Package(Struct, frozen=True):
    """A required package. ``version`` is the installed version (empty if none); ``fits``: whether it is suitable."""

    name: str
    required_versions: str  # the versions that suit, as in ``>=2.0``
    version: str
    fits: bool = True  # whether the installed version suits


class Port(Struct, frozen=True):
    """A serial port. Members of ``group`` may open it. ``holder`` is the program that has it open, or empty."""

    name: str
    about: str = ""
    usb: bool = True
    permitted: bool = True  # whether this user may open it
    group: str = "dialout"
    holder: str = ""  # the program that has it open
    modem_manager_ignores: bool = False


class GatewayFacts(Struct, frozen=True):
    """A running gateway: process id; its mount's name or endpoint, the addresses where clients connect, and its state
    folder; or, if it cannot be queried (``mount`` is empty), its user and whether that is another user.
    """

    pid: int
    mount: str = ""
    user: str = ""
    is_other_users: bool = False
    addresses: tuple[str, ...] = ()
    state_folder: str = ""
    #: How its sky is calculated: by which almanac, or by closed formulas.
    sky_source: str = ""


class Facts(Struct, frozen=True):
    """Everything that the checks need to know about this computer at one moment."""

    version: str
    python: tuple[int, int, int]
    system: str  # the operating system and machine
    now: float
    #: When the astronomy data were published.
    published: float | None
    #: The last day that the almanac covers from today on without a gap; None if it does not have today.
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
    state_problem: str  # why the state folder cannot be written to, or empty
    gateways: list[GatewayFacts]
    #: The pip command of this environment, for the user to type.
    pip: str = "pip"

    @property
    def lacks_astropy(self) -> bool:
        """Whether astropy is not installed; an almanac from another computer can replace it."""
        return any(package.name == "astropy" and not package.version for package in self.packages)
