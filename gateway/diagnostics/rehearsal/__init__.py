"""Rehearsals: commands carried out by a complete gateway on a simulated mount, in virtual time.

``explain`` shows what one command does; a test plays all of them and compares the result with the tables. No part of
the gateway is replaced: what is shown is what a real gateway would send.
"""
