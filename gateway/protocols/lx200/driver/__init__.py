"""The LX200 driver: turns operations into commands of the connected Meade."""
