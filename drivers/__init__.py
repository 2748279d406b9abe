"""The drivers that ship with heli3dof, one for each URL scheme: package ``heli3dof_drivers``."""
