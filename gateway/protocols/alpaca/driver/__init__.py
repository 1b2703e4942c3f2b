"""The driver of Alpaca telescopes: turns operations into requests for members of ASCOM's telescope interface."""
