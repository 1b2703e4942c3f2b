"""The report of a night: a recording as one HTML file with plots, for observers and for those who help them.

``gather`` reads the recording once into a ``Night``; everything else works on that. Times are UTC.
"""
