"""The hand control that was found, and the properties that follow from its model and version alone."""

from __future__ import annotations

from collections.abc import Mapping

from gateway.core.errors import Silence, Unsupported
from gateway.core.operations import Identity, Own
from gateway.protocols.base.driver import Driver, Handler, Send, Steps
from gateway.protocols.nexstar.counting import key_speed, rate_tables
from gateway.protocols.nexstar.versions import NEXSTAR_VARIANT, STARSENSE_VARIANT, numbered
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model, Version

#: The version that is presented until the hand control has reported its own.
FIRST_SHOWN: Version = (4, 21)
#: Timeout of ``v``, seconds: not every version answers it.
VARIANT_PATIENCE = 1.5
#: The first version that uses coordinates of date.
JNOW_FROM = (4, 14)
UNKNOWN: Model = {"mount": "fork", "rates": "se", "has": [], "motors": "0.0", "versions": []}


class HandControl(Driver):
    """A hand control: its model and version as the user named them or as it has reported them."""

    protocol = load("nexstar")

    def __init__(self, model: str | None, version: str | None, handlers: Mapping[str, Handler]) -> None:
        super().__init__(handlers)
        self.named_model = model
        named = numbered(version) if version else None
        self.model = model
        self.version: Version | None = named.counts_as if named else None
        self.version_text = "?"
        #: The replies to ``V`` and ``m``.
        self.shown: Version | None = None
        self.number: int | None = None
        #: Commands that it has not answered.
        self.unanswered: set[str] = set()
        self.starsense = named is not None and named.starsense
        self.motors: dict[int, Version] = {}
        self.focuser = False
        self.found: set[str] = set()

    def presented(self) -> Model:
        """Return the row of its model with the reported values; ``counts_as`` is the version whose commands it has."""
        shown = self.shown or FIRST_SHOWN
        return {
            **self.facts,
            "id": self.facts.get("id", self.number or 0),
            "name": self.model or "unknown",
            "version": shown,
            "counts_as": self.version or shown,
            "own": True,
            "variant": STARSENSE_VARIANT if self.starsense else NEXSTAR_VARIANT,
        }

    def reported_model(self, identity: Identity) -> str | None:
        if self.number is None:
            return None
        rows = self.protocol.models
        if self.named_model in rows and rows[self.named_model].get("id") == self.number:
            return self.named_model
        return next((name for name, row in rows.items() if row.get("id") == self.number), f"model {self.number}")

    def own(self, operation: Own) -> Steps:
        """Pass a client's command on and return the raw reply. Which versions answer ``v`` is not documented.

        Raises Unsupported if the hand control lacks the command or has not answered it.
        """
        if not self.supports(operation.command) or operation.command in self.unanswered:
            raise Unsupported
        patience = VARIANT_PATIENCE if operation.command == "v" else None
        try:
            return (yield Send(operation.command, dict(operation.fields), patience, raw=True))["raw"]
        except Silence:
            self.unanswered.add(operation.command)
            raise Unsupported from None

    def probe(self) -> Steps:
        """Send ``K``, which is no command of a Meade."""
        yield Send("K", {"echo": 0x78})

    @property
    def facts(self) -> Model:
        """The row of ``models.toml``; an unknown mount counts as an alt-az fork without extras."""
        return self.protocol.models.get(self.model or "", UNKNOWN)

    @property
    def loses_alignment(self) -> bool:  # type: ignore[override]
        """Whether setting site or time destroys its alignment, as on a StarSense."""
        return self.starsense

    @property
    def emulates_sync(self) -> bool:  # type: ignore[override]
        """Whether there is no sync command, which came with 4.10: the driver keeps an offset."""
        return not self.supports("s")

    @property
    def moves_by_gotos(self) -> bool:  # type: ignore[override]
        """Whether hand motion consists of small gotos: before 1.6 there is no pass-through to the motors."""
        return not self.supports("slew_azm_pos")

    @property
    def equinox(self) -> str:  # type: ignore[override]
        """Up to 4.13, and on every GT, J2000 according to Celestron's own driver; other sources disagree."""
        if self.starsense or self.version is None or self.version >= JNOW_FROM:
            return "jnow"
        return "j2000"

    @property
    def german(self) -> bool:  # type: ignore[override]
        return bool(self.facts["mount"] == "german")

    def has(self, part: str) -> bool:
        return part in self.facts["has"] or part in self.found

    @property
    def rates(self) -> Model:
        """The key speeds of the mount's family."""
        return rate_tables()[self.facts["rates"]]

    def key_speed(self, key: int) -> float:
        """Return the speed of a hand-control key (1-9), degrees a second."""
        return key_speed(self.rates, key)
