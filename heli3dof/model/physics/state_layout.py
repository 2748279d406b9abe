"""Indices of the flat arrays that the rigid body, the effects and the filters share.

Every compiled function reads one array ``s``, the context: the rig's state and parameters. Each
function of an effect also gets a row ``par``: its axis (−1 without one), then the effect's values
in the order of its `Parameter` list. Cached machine code of effects contains these indices: append
new ones and never renumber.
"""

from __future__ import annotations

import enum

import numpy as np

from heli3dof.rig.profile import Profile, g

T = 0
"""s, time since the recording's first sample"""
R, P, PSI = 1, 2, 3
"""Roll, pitch, yaw in rad; index ``R + axis``"""
R_DOT, P_DOT, PSI_DOT = 4, 5, 6
"""Rates of roll, pitch, yaw in rad/s; index ``R_DOT + axis``"""
F_FRONT, F_BACK = 7, 8
"""N, thrusts: in `Stage.THRUST` before the thrust effects, in `Stage.TORQUE` after them"""
V_FRONT, V_BACK = 9, 10
"""V, voltages at the motors before the effects of `Stage.VOLTAGE`"""

L_A, L_H, L_W = 12, 13, 14
"""m, distances: yaw axis to body, body's centre to a motor, yaw axis to counterweight"""
K_F = 15
"""N/V, thrust per volt of the profile"""
T_G = 16
"""N·m, gravity's torque on the level arm"""
J_R, J_P, J_PSI = 17, 18, 19
"""kg·m², inertias of the level rig; index ``J_R + axis``"""
TAU_M = 20
"""s, time constant of the rotors' lag"""
GAIN_FRONT, GAIN_BACK = 21, 22
"""Thrust per volt relative to K_f"""
DELAY = 23
"""s, delay from a commanded voltage to the motors"""
V_O, V_MAX = 24, 25
"""V: the profile's hover voltage and its amplifier's limit"""
M_W, M_F, M_B = 26, 27, 28
"""kg, masses of counterweight, front and back motor"""
REST = 29
"""rad, the angle at which an encoder counts from zero; index ``REST + axis``"""
G_P = 32
"""N·m, gravity's torque on the level body, (m_f − m_b) g L_h"""
SLEW = 33
"""V/s, slew limit of a rotor's spin-up; 0: no limit."""
SPEED_FRONT, SPEED_BACK = 34, 35
"""V, the rotors' speeds as their steady-state voltages"""
FLANK = 37
"""Side of an encoder's backlash, index ``FLANK + axis``: 1 for a rising, −1 for a falling angle, 0
for the middle of the gap; 2 in simulations, where the effect's memory decides."""
STEPPED = 40
"""1 in a simulation step, which applies dry friction at its end; 0 if accelerations are evaluated
outside a step, where dry friction is a smoothed torque."""
LINEAR = 41
"""λ of `rigid_body`: 0 is the rigid body, 1 the paper's hover model (linearised at level hover)"""
BODY_P, BODY_PSI = 42, 43
"""kg·m², the parts of J_P and J_PSI from the profile's masses; see `rigid_body`"""
UNCOUPLED = 44
"""κ of `rigid_body`: 0 is the rigid body, 1 equations without the bar's inertia couplings"""
CONSTANT_YAW_INERTIA = 45
"""ν of `rigid_body`: 0 is the rigid body, 1 equations with a constant inertia about the vertical"""
WITHOUT_RATE_PRODUCTS, SIDE_THRUST = 46, 47
"""μ, η of `rigid_body`, 0 to 1, in q̈_alone: μ = 1 omits the products of rates, η = 1
keeps the yaw torque L_h sin r D"""
SIZE = 48

AXIS, A, B, C, D = 0, 1, 2, 3, 4
PARAMETERS = 10
"""The length of a row of ``par``."""
MEMORY = 8
"""The length of a row of ``mem``, which a function keeps from sample to sample."""


class Stage(enum.IntEnum):
    """The points of a simulation at which an effect's ``f(s, par, mem, out)`` is called."""

    SETUP = 0
    """Called once before a simulation. Change the rig parameters in ``out``, which is ``s``."""
    VOLTAGE = 1
    """Called once a sample. Change ``out`` (2,) V, the motors' voltages (front, back), in place."""
    THRUST = 2
    """Called whenever accelerations are computed. Change ``out`` (2,) N, the thrusts, in place."""
    TORQUE = 3
    """Called whenever accelerations are computed. Add to ``out`` (3,) N·m, torques on roll, pitch,
    yaw."""
    MEASURE = 4
    """Called once a sample. Change ``out`` (3,) rad, the encoders' readings, in place."""
    DRY = 5
    """Called after every time step. Add to ``out`` (3,) N·m, the largest dry friction torques."""


def context(profile: Profile) -> np.ndarray:
    """Return the simulation's array s for the profile's rig at rest, without effects.

    s (`SIZE`,) contains the parameters of the rig and the state of the simulation. The constants of
    this module (`L_A`, `K_F`, …) are its indices.
    """
    p = profile
    s = np.zeros(SIZE)
    s[L_A], s[L_H], s[L_W] = p.geometry.L_a, p.geometry.L_h, p.geometry.L_w
    s[K_F] = p.motor.K_f
    s[T_G] = p.trim_torque
    s[J_R : J_R + 3] = p.inertias
    # Inertia beyond that of the profile's masses rotates with the joint alone (`rigid_body`).
    s[BODY_P], s[BODY_PSI] = p.mass_inertias[1:]
    s[GAIN_FRONT] = s[GAIN_BACK] = 1.0
    s[V_O], s[V_MAX] = p.motor.V_o, p.motor.v_max
    s[M_W], s[M_F], s[M_B] = p.mass.m_w, p.mass.m_f, p.mass.m_b
    s[REST : REST + 3] = p.encoder.rest_rad
    s[G_P] = (p.mass.m_f - p.mass.m_b) * g * p.geometry.L_h
    return s
