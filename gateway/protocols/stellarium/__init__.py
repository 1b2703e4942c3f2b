"""The protocol of Stellarium's plug-in Telescope Control: positions are pushed, a goto has no reply."""
