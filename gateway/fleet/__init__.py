"""Many mounts on one MQTT broker: every gateway shows its own there, and one page shows them all.

The broker is a guest. It has a thread of its own, so that a mount's work goes on whatever the broker does; what is to
be sent waits in a bounded place, and what comes is small or it is not looked at. Orders take the way of every person's.
"""
