"""The log: the conversation of a gateway with its programs and its mount, in words that a person reads.

Three steps, each in a file of its own: ``conversation`` puts an entry of the wire log into words by the tables,
``folding`` leaves out what only repeats and what was not asked for, ``layout`` makes lines of what is left, or
``as_json`` objects. ``decode`` shares the first; another form of output replaces the last alone.
"""
