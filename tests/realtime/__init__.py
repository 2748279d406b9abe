"""Flights in real time: punctuality, kill -9, a soak; short in tests, long in `make bench`.

Each runs the command line in a process of its own, with its progress display on a
pseudo-terminal, as a user does.
"""
