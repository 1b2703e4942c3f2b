"""The object library: it finds the positions of objects by their catalogue numbers.

The catalogues are third-party packages, read from where they are installed (the extra ``library``): OpenNGC for
Messier, NGC, IC, Caldwell and UGC, the new reduction of Hipparcos for stars, and for their numbers in SAO, HD and HR a
list that is not part of the extra (``stars.py``). Positions are J2000, in degrees. If a catalogue is not installed,
NotInstalled is raised; a number that it does not have gives None. A look-up takes 1 to 20 ms, a search with new limits
40 ms, so no thread is needed. Files are read on first use.
"""
