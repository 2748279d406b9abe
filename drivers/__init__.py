"""The drivers that ship with heli3dof; imported as ``heli3dof_drivers``."""
