"""The console: a page in the browser that shows the mounts of this gateway and lets the user move and stop them.

It is a client of each mount like any other: the same limits, the same order, the same refusals, with reasons. The files
of the page are in ``page/``; the browser loads nothing from anywhere else.
"""
