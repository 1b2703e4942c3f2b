"""The console: a page in the browser that shows the mounts of this gateway, and lets a person move and stop them.

It is a client of each mount like any other: the same limits, the same order, the same refusals, in words. The page's
own files lie in ``page/``; nothing is fetched from anywhere else.
"""
