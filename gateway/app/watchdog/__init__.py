"""The watchdog: a second, small process that stops the mount if the gateway dies or hangs during a motion."""
