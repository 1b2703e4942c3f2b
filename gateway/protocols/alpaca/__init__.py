"""ASCOM's Alpaca: the members of its telescope interface, asked for over HTTP."""
