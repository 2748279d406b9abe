"""Drivers that come with heli3dof; imported as ``heli3dof_drivers``."""
