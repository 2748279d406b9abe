"""Define the method ``greybox``: physical parameters by maximum likelihood."""

from heli3dof.identification.method import Method

METHOD = Method(
    "greybox",
    "physical parameters by maximum likelihood (extended Kalman filter, encoder edges)",
    "heli3dof.identification.greybox.noise_check:fit",
    physical=True,
)
