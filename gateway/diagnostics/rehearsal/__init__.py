"""Rehearsals: commands carried out by the whole gateway on a simulated mount, in virtual time.

``explain`` shows what one of them does, ``tables --check --wire`` plays them all and compares what was seen with what
the tables say. Nothing here stands in for a part of the gateway: what is shown is what the wire carries.
"""
