"""Models from recordings: preprocessing, feedback test, fit, validation.

`identify.identify` does all of it. Each method is one file in `methods`. docs/explanation/identification.md
explains the choices. This package imports nothing by itself, so that listing the methods is fast.
"""
