"""The host's side of the link, the byte protocol between host and rig, over serial line or USB.

docs/reference/protocol.md defines it.
"""
