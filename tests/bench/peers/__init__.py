"""Runs other identification tools (peers) on the same flights, with one adapter file for each.

A peer runs in its own process, in ``.venv-peers``, and exchanges two files with the benchmark: it
reads a task (`interface.Task`) and writes its model (`interface.write_linear`,
`interface.write_physical`). Its adapter imports numpy, scipy, the peer and this folder's
`interface`, `sampling` and `rigid`; not heli3dof. ``make bench-peers`` runs them all.
"""
