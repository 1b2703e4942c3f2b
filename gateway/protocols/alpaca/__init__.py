"""ASCOM Alpaca: the members of the telescope interface over HTTP."""
