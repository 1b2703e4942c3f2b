"""ASCOM Alpaca in processes of the product."""
