"""The log: the conversation of a gateway with its clients and its mount, in words for people.

There are three steps, one file each: ``conversation`` describes an entry of the wire log with the words of the tables,
``folding`` removes repetitions and whatever the user did not ask for, and ``layout`` formats the rest as lines, or
``as_json`` as JSON objects. ``decode`` reuses the first step; another output format would replace only the last one.
"""
