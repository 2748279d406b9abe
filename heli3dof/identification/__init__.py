"""Identify models from recordings: preprocessing, feedback test, fit, bias correction, validation.

`identify.identify` runs all steps. Each identification method is one file in `methods`.
docs/explanation/identification.md explains the choices.
"""
