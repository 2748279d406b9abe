"""The host's side of the link, over a serial line or USB; docs/reference/protocol.md."""
