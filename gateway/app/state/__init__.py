"""What is kept on disk: settings of the mount, the hold, the marker of a motion."""
