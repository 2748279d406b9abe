"""Names for the places in the flat arrays that the rigid body, its effects and the filter share.

Every compiled function reads one context ``s``: where the rig is, and the numbers it is made of.
An effect has one row of parameters: its axis (−1 without one), then its values in the order of
its `Parameter` list. Machine code is cached with these numbers in it: append, never renumber.
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
"""s, from a commanded voltage to the motors"""
V_O, V_MAX = 24, 25
"""V: the profile's hover voltage, and its amplifier's limit"""
M_W, M_F, M_B = 26, 27, 28
"""kg"""
REST = 29
"""rad, where the encoders count from; ``REST + axis``"""
G_P = 32
"""N·m, gravity's torque on the level body, front motor heavier than back"""
SLEW = 33
"""V/s, the fastest that a rotor spins up; 0 where nothing limits it."""
SPEED_FRONT, SPEED_BACK = 34, 35
"""V, the rotors' speeds: the voltage that would keep them"""
FLANK = 37
"""Which flank of an encoder's play carries it; ``FLANK + axis``: 1 the angle rises, −1 it falls,
0 neither, the middle of the play; 2, in flights, what the effect remembers says."""
STEPPED = 40
"""1 while a step is taken, whose dry friction comes at its end; 0 where accelerations alone are
asked for, and dry friction is among the torques, its step smoothed."""
LINEAR = 41
"""0 the rigid body … 1 the paper's hover model, which is the rigid body linearised level."""
BODY_P, BODY_PSI = 42, 43
"""kg·m², what the profile's masses give of J_P and J_PSI; the rest is rotary, on the joints"""
UNCOUPLED = 44
"""0 the rigid body … 1 without the bar's part in how roll, pitch and yaw push each other."""
CONSTANT = 45
"""0 the rigid body … 1 with the arm's inertia about the vertical held at its level value."""
UNTHROWN, SIDEWAYS = 46, 47
"""As far as `UNCOUPLED`: 1 without products of rates; 1 with the thrusts' part about the vertical
all the same."""
SIZE = 48

AXIS, A, B, C, D = 0, 1, 2, 3, 4
PARAMETERS = 6
"""The length of an effect's row."""
MEMORY = 8
"""Numbers that an effect may remember from sample to sample."""


class Stage(enum.IntEnum):
    """When an effect's function is called, and what its ``out`` holds then."""

    SETUP = 0
    """Once; ``out`` is ``s`` itself, whose numbers of the body may be changed."""
    VOLTAGE = 1
    """Once a sample; ``out`` (2,) V at the motors, front and back, to be changed in place."""
    THRUST = 2
    """At every evaluation; ``out`` (2,) N, the thrusts, to be changed in place."""
    TORQUE = 3
    """At every evaluation; ``out`` (3,) N·m, torques on roll, pitch, yaw, to be added to."""
    MEASURE = 4
    """Once a sample; ``out`` (3,) rad, what the encoders see, to be changed in place."""
    DRY = 5
    """After every step; ``out`` (3,) N·m, the most that dry friction holds with, to be added to."""
