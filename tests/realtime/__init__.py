"""Runs in real time: punctuality, kill -9, a soak. Flown short by the tests, long by `make bench`.

Each flies the command line itself, in a process of its own with its progress display on a
pseudo-terminal, so that what is measured is what people run.
"""
