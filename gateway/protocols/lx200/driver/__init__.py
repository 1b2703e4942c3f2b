"""The LX200 driver: operations become the commands of the Meade that was found."""
