"""Stellarium's telescope protocol, of its plug-in Telescope Control: positions are pushed, a goto has no reply."""
