"""A guided check of the mount that is really there, against what the gateway believes of mounts of its kind.

It drives through the ordinary gateway, as a person at the command line does: every rule and limit applies, and a
recording of the gateway holds all of it. It never syncs, parks, hibernates or changes the alignment, the site or the
clock. ``guide`` leads through the stages; each stage is a file.
"""
