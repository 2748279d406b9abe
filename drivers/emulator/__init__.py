"""The emulated rig: nonlinear rigid body, electronics, and hidden effects to be diagnosed.

The emulator shares no equation with ``heli3dof.model``: its equations are derived from a separate
Lagrangian. So tests of the model against the emulator reveal an error in either. Reading order:
`lagrange` (equations), `kernel` (integration), `body` (parameters), `effects`, `plant` (one control
period, random numbers), `device` (amplifier, watchdog, stops).
"""
