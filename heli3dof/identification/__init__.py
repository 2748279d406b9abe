"""Identify models from recordings: preprocessing, feedback test, fit, bias correction, validation.

`identify.identify` runs all steps. `methods` lists the identification methods.
docs/explanation/identification.md explains the choices.
"""
