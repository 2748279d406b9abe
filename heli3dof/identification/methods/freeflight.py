"""Define the method ``freeflight``: physical parameters from multi-step predictions."""

from heli3dof.identification.method import Method

METHOD = Method(
    "freeflight",
    "physical parameters from free-run predictions of up to 3 s, for logs without a likelihood",
    "heli3dof.identification.greybox.freeflight:fit",
    physical=True,
)
