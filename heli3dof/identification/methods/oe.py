"""Define the method ``oe``: a state-space black box by output error (simulation errors)."""

from heli3dof.identification.method import Method

METHOD = Method(
    "oe",
    "output error (K = 0) in state-space form",
    "heli3dof.identification.black_box.state_space:fit",
    assumes_open_loop=True,
)
