"""The emulated rig: a nonlinear rigid body, its electronics, and the effects it can hide.

It shares no equation with ``heli3dof.model``: the plant is derived here from its own Lagrangian, so
an error in one does not hide in the other. Reading order: `lagrange` (equations), `kernel`
(integration), `body` (parameters), `effects`, `plant` (one control period, seeded), `device`
(amplifier, watchdog, latches).
"""
