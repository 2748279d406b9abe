"""``pem``: prediction error in innovation form."""

from heli3dof.identification.method import Method

METHOD = Method(
    "pem",
    "prediction error in innovation form, started from PBSID-opt",
    "heli3dof.identification.black_box.state_space:fit",
)
