"""Readers of model files, one module for each form.

A module ``heli3dof.model.serialization.<form>`` offers ``from_dict(data) -> Model``. It may raise
KeyError, TypeError or ValueError for content that does not fit. The model's own ``to_dict`` writes
``"form": "<form>"``; a new form needs no other entry.
"""
