"""Other people's identification tools on our flights, one adapter file each.

A peer runs in a process of its own, in ``.venv-peers``, and meets us through two files only: it
reads a task (`interface.Task`) and writes what it found (`interface.write_linear`,
`interface.write_physical`). Its adapter imports numpy, scipy, the peer and this folder's
`interface`, `sampling` and `rigid`; never heli3dof. ``make bench-peers`` runs them all.
"""
