"""The gateway's state on disk: settings of the mount, the hold, the motion marker."""
