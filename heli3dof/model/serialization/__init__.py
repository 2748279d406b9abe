"""The forms a model file may take: one module each, found by its name.

A module ``heli3dof.model.serialization.<form>`` offers ``from_dict(data) -> Model``, which may
raise KeyError, TypeError or ValueError where the content does not fit, and the model's ``to_dict``
writes ``"form": "<form>"``. Nothing else has to know of it.
"""
