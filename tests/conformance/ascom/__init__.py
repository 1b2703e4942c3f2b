"""What ASCOM's judge checks of a telescope, asked of the Alpaca surface on virtual time."""
