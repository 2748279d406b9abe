"""``pbsid``: PBSID-opt, a subspace method."""

from heli3dof.identification.method import Method

METHOD = Method(
    "pbsid",
    "PBSID-opt subspace identification",
    "heli3dof.identification.black_box.state_space:fit",
)
