"""Package ``heli3dof_drivers``: the drivers of heli3dof, one per URL scheme (``serial:``, …)."""
