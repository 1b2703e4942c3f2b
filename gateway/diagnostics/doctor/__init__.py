"""``doctor``: what of this computer could keep a gateway from working, and what to do about each.

``facts`` says what is looked at; ``gathering`` and ``installed`` look; ``checks`` judge.
A check is a function of the facts alone and one row of ``CHECKS``; it asks nothing, so a test can hand it any computer.
"""
