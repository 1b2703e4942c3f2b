"""Real programs (INDI drivers, Hamlib) against the product, started as its users start it.

Nothing here imports the product: it is run as a process and judged from outside, by what a
program of others makes of it and by what a second wire to the simulated hand control says.
"""
