"""The host's side of the heli3dof link, over a serial line or USB pipes; docs/protocol.md."""
