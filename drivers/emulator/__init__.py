"""The emulated rig: a nonlinear rigid body, its electronics, and effects for a diagnosis to find.

It shares no equation with ``heli3dof.model``: the plant is derived here from its own Lagrangian, so
tests against the emulator reveal an error in either. Reading order: `lagrange` (equations),
`kernel` (integration), `body` (parameters), `effects`, `plant` (one control period, seeded),
`device` (amplifier, watchdog, latches).
"""
