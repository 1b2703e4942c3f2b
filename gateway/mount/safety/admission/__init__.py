"""Before a motion: is it allowed, and in which form can this mount carry it out?"""
