"""The picture of a night: a recording as one HTML file with plots, for people who were there and for those who help.

``gather`` reads the recording once into a ``Night``; everything else only looks at that. Times are UTC.
"""
