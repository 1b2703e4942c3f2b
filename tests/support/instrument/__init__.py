"""The instrument of safety: legitimate evenings and attacks on whole gateways, judged by the true axes of the mount.

``python -m tests.support.instrument --help`` says how to play them and print their tables.
"""
