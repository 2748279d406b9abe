"""heli3dof: from a 3-DOF helicopter on the bench to a model that can be trusted."""
