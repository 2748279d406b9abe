"""Define the method ``pem``: a state-space black box by one-step prediction errors."""

from heli3dof.identification.method import Method

METHOD = Method(
    "pem",
    "prediction error in innovation form, started from PBSID-opt",
    "heli3dof.identification.black_box.state_space:fit",
)
