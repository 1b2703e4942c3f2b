"""What the driver knows of the Meade it has found, and what it remembers between two operations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import Struct

from gateway.driver import Ask, Driver, Pause, Steps
from gateway.errors import Busy, Unsupported
from gateway.operations import Place, Tracking
from gateway.tables import load

SIDEREAL = 15.041067  # arcseconds a second
BUSY_RETRIES, BUSY_WAIT = 6, 0.4
#: What takes a telescope long, in seconds at most: a classic calculates its planets, an LX200GPS finds its satellites.
LONG = {"SC": 14.0, "gT": 600.0}
#: All that is understood while it seeks its home; a Meade that is asked anything else says NAK, or nothing.
WHILE_SEEKING = frozenset({"hS", "hF", "Q", "h?"})


class GotoState(Struct):
    """A goto under way: since when, what it is for, and how often the bars have been empty."""

    since: float
    then: str | None = None
    quiet: int = 0


class Meade(Driver):
    """A Meade telescope. ``now`` is any clock that never goes back, in seconds."""

    protocol = load("lx200")
    takes_site_aligned = True

    def __init__(self, now: Callable[[], float], model: str | None = None) -> None:
        from gateway.protocols.lx200.driver import SPECIALS  # the specials know this class

        self.specials = SPECIALS
        self.now = now
        self.named_model = self.model = model
        self.product, self.firmware = "", ""
        self.low = False
        # alignment and tracking
        self.letter = "A"
        self.home_letter = "A"
        self.tells_status = False
        self.aligned = True
        self.tracking = Tracking.ALTAZ
        # motion
        self.goto: GotoState | None = None
        self.moving: dict[int, str] = {}
        self.pulsing: dict[int, str] = {}
        self.parked = False
        self.guide_rate = 1.0  # what is meant by it, a fraction of sidereal
        self.site: Place | None = None
        self.power_on()

    def power_on(self) -> None:
        """What no Meade tells, as after switching it on: that may have happened while the line was lost."""
        #: It seeks its home; ``fastest`` is what :Sw was sent last, degrees a second.
        self.seeking = False
        self.fastest: int | None = None
        #: Axes with a rate of their own (:RA :RE); the guide rate sent last (:Rg); whether it corrects periodic errors.
        self.free_axes: set[int] = set()
        self.guides_at = 1.0
        self.corrects = False

    @property
    def facts(self) -> dict[str, Any]:
        """The row of models.toml; unknown telescopes are driven as an Autostar."""
        return self.protocol.models[self.model or "autostar"]

    @property
    def gps(self) -> bool:  # type: ignore[override]
        return self.model == "lx200gps"

    @property
    def equatorial(self) -> bool:
        return self.home_letter in "PG"

    @property
    def southern(self) -> bool:
        return self.site is not None and self.site.latitude < 0


def ask(mount: Meade, command: str, **values: Any) -> Steps:
    """Send a command; a busy telescope (NAK) is waited for, a few times. Raises Unsupported for what it lacks."""
    if not mount.knows(command):
        raise Unsupported(f"This model knows no {command if command == 'ACK' else f':{command}#'}.")
    if mount.seeking and command not in WHILE_SEEKING:
        raise Busy("The mount seeks its home.")
    for attempt in range(BUSY_RETRIES):
        try:
            return (yield Ask(command, {**values, "low": mount.low}, LONG.get(command), command in LONG))
        except Busy:
            if attempt == BUSY_RETRIES - 1:
                raise
            yield Pause(BUSY_WAIT)
    return None
