"""The mechanics that all simulated mounts share: two motors as functions of time."""
