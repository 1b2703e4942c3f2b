"""Decides before a motion whether it is allowed, and in which form this mount can carry it out."""
