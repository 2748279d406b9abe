"""`context`: the context array of a rig at rest, from its profile."""

from __future__ import annotations

import numpy as np

from heli3dof.model.physics import state_layout as _s
from heli3dof.rig.profile import Profile, g


def context(profile: Profile) -> np.ndarray:
    """Return the context array s (`state_layout`) of the profile's rig at rest, without effects."""
    p = profile
    s = np.zeros(_s.SIZE)
    s[_s.L_A], s[_s.L_H], s[_s.L_W] = p.geometry.L_a, p.geometry.L_h, p.geometry.L_w
    s[_s.K_F] = p.motor.K_f
    s[_s.T_G] = p.trim_torque
    s[_s.J_R : _s.J_R + 3] = p.inertias
    # Inertia beyond that of the profile's masses rotates with the joint alone (`rigid_body`).
    s[_s.BODY_P], s[_s.BODY_PSI] = p.mass_inertias[1:]
    s[_s.GAIN_FRONT] = s[_s.GAIN_BACK] = 1.0
    s[_s.V_O], s[_s.V_MAX] = p.motor.V_o, p.motor.v_max
    s[_s.M_W], s[_s.M_F], s[_s.M_B] = p.mass.m_w, p.mass.m_f, p.mass.m_b
    s[_s.REST : _s.REST + 3] = p.encoder.rest_rad
    s[_s.G_P] = (p.mass.m_f - p.mass.m_b) * g * p.geometry.L_h
    return s
