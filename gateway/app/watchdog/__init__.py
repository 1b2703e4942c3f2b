"""The watchdog: a second, small process that stops the mount when its gateway dies or hangs while something moves."""
