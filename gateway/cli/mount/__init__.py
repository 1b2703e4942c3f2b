"""Commands that send requests about the mount to a running gateway."""
