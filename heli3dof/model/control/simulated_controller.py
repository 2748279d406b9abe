"""The controller in simulated flights: that of the profile, or one identified from a log.

One compiled function, `simulated_law`, computes the voltages of either controller from parameters p
and a state s. For the profile's controller, p and s are those of `controller.control_law`; p[0] is
the control period. An identified controller is linear, of order n (`recording.linear_controller`):

    v[k] = clip(Σ_{j=1…n} A_j v[k−j] + Σ_{j=0…n} B_j y[k−j] + w[k], ±v_max)

v are the motor voltages (V), y the angles (rad). The input w (V) contains the effect of references
and excitation on the voltages. It is passed in the argument ``extra``, which for the profile's
controller is the excitation alone. For an identified controller, p[0] is negative:

    p = [−n, v_max, A_1 … A_n, B_0 … B_n]        s = [v[k−1] … v[k−n], y[k−1] … y[k−n]]
"""

from __future__ import annotations

from functools import partial

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.model.compiled import compiled
from heli3dof.model.control.controller import control_law, parameters, state_at_rest
from heli3dof.recording.linear_controller import LinearController
from heli3dof.rig.profile import ControllerSpec


def controller_arrays(
    controller: ControllerSpec | LinearController, V_o: float, v_max: float, dt: float,
    angle0: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return the parameters p and the initial state s of a controller, for `simulated_law`.

    ``V_o``: hover voltage (V); ``v_max``: voltage limit (V); ``dt``: control period (s);
    ``angle0`` (3,) rad: angles at which the rig rests before the flight. A linear controller uses
    only ``v_max``; its state starts at zero.
    """
    if isinstance(controller, LinearController):
        n = len(controller.A)
        p = np.concatenate([[-n, v_max], controller.A.ravel(), controller.B.ravel()])
        return p, np.zeros(5 * n)
    spec = parameters(controller, V_o, v_max, dt)
    return np.array(spec), np.array(state_at_rest(spec, [float(a) for a in angle0]))


@partial(compiled, leaf=True)
def _linear_law(p, s, angle, extra, out):  # type: ignore[no-untyped-def]
    """Compute one control period of a linear controller; update its state ``s``.

    ``p``, ``s``: see the head of this file; ``angle`` (3) rad: measured; ``extra`` (2) V: the input
    w. ``out`` (4) gets the voltages (front, back), then the same limited to ±v_max.
    """
    n = int(-p[0])
    B = 2 + 4 * n
    for m in range(2):
        v = extra[m]
        for i in range(3):
            v += p[B + 3 * m + i] * angle[i]
        for j in range(n):
            for i in range(2):
                v += p[2 + 4 * j + 2 * m + i] * s[2 * j + i]
            for i in range(3):
                v += p[B + 6 * (j + 1) + 3 * m + i] * s[2 * n + 3 * j + i]
        out[m] = v
        if v - v != 0.0:  # NaN or infinite
            v = 0.0
        out[2 + m] = min(max(v, -p[1]), p[1])
    for j in range(n - 1, 0, -1):
        for i in range(2):
            s[2 * j + i] = s[2 * (j - 1) + i]
        for i in range(3):
            s[2 * n + 3 * j + i] = s[2 * n + 3 * (j - 1) + i]
    for i in range(2):
        s[i] = out[2 + i]
    for i in range(3):
        s[2 * n + i] = angle[i]


_profile_law = compiled(control_law, leaf=True)


@partial(compiled, leaf=True)
def simulated_law(p, s, angle, reference, extra, out):  # type: ignore[no-untyped-def]
    """Compute one control period of the profile's controller or of one identified from a log.

    p[0] is negative for an identified controller. This linear controller ignores ``reference``,
    because its input w, which is passed as ``extra``, contains the effect of the references. The
    arguments are those of `heli3dof.model.control.controller.control_law`.
    """
    if p[0] < 0.0:
        _linear_law(p, s, angle, extra, out)
    else:
        _profile_law(p, s, angle, reference, extra, out)
