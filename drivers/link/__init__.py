"""The heli3dof link: what both sides of a serial line or a USB pipe say. See protocol.md."""
