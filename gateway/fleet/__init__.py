"""Many mounts on one MQTT broker: every gateway publishes its own mounts there, and one page shows them all.

The connection to the broker has a thread of its own, so that a slow broker never delays a mount; outgoing messages wait
in a bounded buffer, and messages that are too large are not read. Orders are carried out like those of any other user.
"""
