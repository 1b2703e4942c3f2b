"""Recording a session: everything that comes in from outside, with its time."""
