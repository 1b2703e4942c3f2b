"""The line to the mount: one exchange at a time, in order of priority, and the verification of replies."""
