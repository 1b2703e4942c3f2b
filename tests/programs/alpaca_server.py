"""The simulated Alpaca server, read past the gateway: the truth a test compares with, asked in the words of ASCOM."""

from __future__ import annotations

import json
import urllib.request

from .processes import PATIENCE
from .sky import Spot


class AlpacaServer:
    """Telescope 0 of a server; every answer comes in bounded time."""

    def __init__(self, port: int) -> None:
        self._url = f"http://127.0.0.1:{port}/api/v1/telescope/0/"

    def ask(self, member: str) -> float:
        """The value of a property."""
        with urllib.request.urlopen(
            f"{self._url}{member}?ClientID=7&ClientTransactionID=1", timeout=PATIENCE
        ) as answer:
            told = json.load(answer)
        assert told["ErrorNumber"] == 0, told
        return float(told["Value"])

    def position(self) -> Spot:
        """Right ascension (hours there) and declination, of date."""
        return Spot(self.ask("rightascension") * 15.0, self.ask("declination"))

    def horizontal(self) -> tuple[float, float]:
        """Azimuth and altitude in degrees."""
        return self.ask("azimuth"), self.ask("altitude")

    def goto_running(self) -> bool:
        return bool(self.ask("slewing"))
