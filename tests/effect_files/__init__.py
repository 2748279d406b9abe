"""Tests of `heli3dof.effect_files`."""
