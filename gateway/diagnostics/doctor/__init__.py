"""``doctor``: find what on this computer could keep a gateway from working, and say what to do about it.

``facts`` defines what is examined, ``gathering`` and ``installed`` collect it, ``checks`` judge it. A check is a pure
function of the facts and one row of ``CHECKS``, so that a test can describe any computer.
"""
