"""Define the method ``pbsid``: a state-space black box by the subspace method PBSID-opt."""

from heli3dof.identification.method import Method

METHOD = Method(
    "pbsid",
    "PBSID-opt subspace identification",
    "heli3dof.identification.black_box.state_space:fit",
)
