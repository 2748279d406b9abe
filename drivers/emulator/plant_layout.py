"""Indices of the arrays that the compiled plant and the effects share.

Compiled effects on disk contain these numbers: append new ones, never renumber.
"""

from __future__ import annotations

import enum

# The context `s` that every effect reads: time, substep, angles, rates, voltages, thrusts.
T = 0
"""s on the device's clock, which is 0 when the simulation of the motion starts"""
H = 1
"""s, the substep"""
R, P, PSI = 2, 3, 4
"""rad, the angles; ``R + axis`` with axis 0, 1, 2"""
R_DOT, P_DOT, PSI_DOT = 5, 6, 7
"""rad/s, the rates; ``R_DOT + axis``"""
V_FRONT, V_BACK = 8, 9
"""V at the motors, after the voltage stage"""
F_FRONT, F_BACK = 10, 11
"""N, the thrusts"""
V_START = 12
"""V on both motors before the start"""
CONTEXT_SIZE = 16

# The body's parameters; see `body.Body` for units and meaning.
L_A, L_H, K_F, T_G, J_W, I_AA, I_BB, I_NN, I_AB, G_P = range(10)
DJ_R, DJ_P, DJ_PSI, TAU_M, GAIN_FRONT, GAIN_BACK, V_REF = range(10, 17)
REST = 17
"""rad, the angles at which the counts are zero; ``REST + axis``"""
COUNTS_PER_RAD = 20
"""signed; ``COUNTS_PER_RAD + axis``"""
LOW, HIGH = 24, 27
"""rad, the lower and upper stops; ``LOW + axis``"""
BODY_SIZE = 32

# An effect's own row of parameters: its axis (−1 without one), then its values.
AXIS, A, B = 0, 1, 2
PARAMETER_SIZE = 6
MEMORY_SIZE = 1024


class Stage(enum.IntEnum):
    """The points of the simulation at which the plant calls effects.

    Each point defines the meaning of the array ``out``, which the effects change.
    """

    BODY = 0
    """once a substep; `out` is the body's parameters (`BODY_SIZE`,), to be changed in place"""
    VOLTAGE = 1
    """once a substep; `out` is the two motor voltages in V, to be changed in place"""
    THRUST = 2
    """at each of the four Runge–Kutta stages; `out` is the two thrusts in N, changed in place"""
    TORQUE = 3
    """at each of the four Runge–Kutta stages; `out` is the torques of roll, pitch, yaw in N·m, to
    which the effect adds its own"""
    DRY_FRICTION = 4
    """once a substep; `out` is the largest dry-friction torque of each axis in N·m, to which the
    effect adds its own"""
    MEASURE = 5
    """once a sample; `out` is the three angles in rad that the encoders see, changed in place"""
