"""The emulated rig: a nonlinear rigid body, its electronics, and the effects it can hide.

It shares no equation with ``heli3dof.model``: the plant is derived here from its own Lagrangian
(`lagrange`), so that agreement between the two says something. Reading order: `lagrange` (the
equations), `kernel` (how they are integrated), `body` (their numbers), `effects` (what can be
hidden), `plant` (one control period, seeded), `device` (amplifier, watchdog, latches).
"""
