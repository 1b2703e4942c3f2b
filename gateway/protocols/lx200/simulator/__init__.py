"""The simulated Meade: its state and mechanics, and the handlers of its commands."""
