"""Readers of model files: one module for each form of model (``linear``, ``greybox``).

A module ``heli3dof.model.serialization.<form>`` offers ``from_dict(data) -> Model``. This function
may raise KeyError, TypeError or ValueError for invalid content. The model's own ``to_dict`` writes
``"form": "<form>"``. A module in this folder is all that a new form needs.
"""
