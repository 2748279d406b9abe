"""Models from recordings: preprocessing, feedback test, fit, validation.

`identify.identify` does all of it. Each method is one file in `methods`. The choices are explained
in docs/explanation/identification.md. This package imports nothing of its own: listing methods is
fast.
"""
