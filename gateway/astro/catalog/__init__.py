"""The object library: numbers in catalogues become places on the sky.

The catalogues are other people's packages, read where they were installed (the extra ``library``):
OpenNGC for Messier, NGC, IC, Caldwell and UGC, the new reduction of Hipparcos for stars, and for their numbers in SAO,
HD and HR a list that is no part of the extra (``stars.py``). Places are J2000, in degrees.
A catalogue that is not installed raises NotInstalled; a number that it does not have is None. A look-up takes
1 to 20 ms, a search 40 ms when its limits are new, so no thread is needed. Nothing is read before it is asked for.
"""
