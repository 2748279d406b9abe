"""Indices of the flat arrays that the rigid body, the effects and the filters share.

Every compiled function reads one context ``s``: the rig's state and parameters. An effect has one
row of parameters: its axis (−1 without one), then its values in the order of its `Parameter` list.
Effects' cached machine code contains these numbers: append, never renumber.
"""

from __future__ import annotations

import enum

T = 0
"""s since the recording's first sample"""
R, P, PSI = 1, 2, 3
"""rad; ``R + axis``"""
R_DOT, P_DOT, PSI_DOT = 4, 5, 6
"""rad/s; ``R_DOT + axis``"""
F_FRONT, F_BACK = 7, 8
"""N, the rotors' thrusts before the thrust stage"""
V_FRONT, V_BACK = 9, 10
"""V at the motors, before the voltage stage"""

L_A, L_H, L_W = 12, 13, 14
"""m"""
K_F = 15
"""N/V"""
T_G = 16
"""N·m, gravity's torque on the level arm"""
J_R, J_P, J_PSI = 17, 18, 19
"""kg·m², level; ``J_R + axis``"""
TAU_M = 20
"""s, the rotors' lag"""
GAIN_FRONT, GAIN_BACK = 21, 22
"""thrust relative to K_f"""
DELAY = 23
"""s, delay from a commanded voltage to the motors"""
V_O, V_MAX = 24, 25
"""V: the profile's hover voltage and its amplifier's limit"""
M_W, M_F, M_B = 26, 27, 28
"""kg"""
REST = 29
"""rad, the angle at which the encoders count from zero; ``REST + axis``"""
G_P = 32
"""N·m, gravity's torque on the level body, front motor heavier than back"""
SLEW = 33
"""V/s, slew limit of a rotor's spin-up; 0: no limit."""
SPEED_FRONT, SPEED_BACK = 34, 35
"""V, the rotors' speeds as their steady-state voltages"""
FLANK = 37
"""The flank of an encoder's backlash; ``FLANK + axis``: 1 the angle rises, −1 it falls, 0 mid-gap;
2 in simulations, where the effect's memory decides."""
STEPPED = 40
"""1 within a simulation step, which applies dry friction at its end; 0 for accelerations alone,
where dry friction is a smoothed torque."""
LINEAR = 41
"""0 the rigid body … 1 the paper's hover model, its linearisation at level hover"""
BODY_P, BODY_PSI = 42, 43
"""kg·m², J_P and J_PSI of the profile's masses; the rest rotates with the joints alone"""
UNCOUPLED = 44
"""0 the rigid body … 1 without the bar's inertia couplings"""
CONSTANT = 45
"""0 the rigid body … 1 with the arm's inertia about the vertical at its level value"""
UNTHROWN, SIDEWAYS = 46, 47
"""Within `UNCOUPLED`: 1 without products of rates; 1 with L_h sin r D on yaw"""
SIZE = 48

AXIS, A, B, C, D = 0, 1, 2, 3, 4
PARAMETERS = 6
"""The length of an effect's row."""
MEMORY = 8
"""The length of an effect's memory from sample to sample."""


class Stage(enum.IntEnum):
    """When an effect's function is called, and the content of its ``out``."""

    SETUP = 0
    """Once; ``out`` is ``s``: change the rig's parameters in it."""
    VOLTAGE = 1
    """Once a sample; ``out`` (2,) V at the motors, front and back: change in place."""
    THRUST = 2
    """At every evaluation; ``out`` (2,) N, the thrusts: change in place."""
    TORQUE = 3
    """At every evaluation; ``out`` (3,) N·m, torques on roll, pitch, yaw: add to it."""
    MEASURE = 4
    """Once a sample; ``out`` (3,) rad, the encoders' readings: change in place."""
    DRY = 5
    """After every step; ``out`` (3,) N·m, the limit of dry friction: add to it."""
