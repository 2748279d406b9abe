"""Effects that select the equations of motion: those of the complete rigid body or simplified ones.

Each function here changes one element of the simulation's parameter array, which the equations
in `heli3dof.model.physics.rigid_body` read.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import (
    CONSTANT_YAW_INERTIA,
    LINEAR,
    SIDE_THRUST,
    UNCOUPLED,
    WITHOUT_RATE_PRODUCTS,
    A,
    Stage,
)


def hover(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The switch for ``--base hover``: the paper's linear hover model replaces the rigid body.

    s[LINEAR] = 1 in the simulation's parameter array s selects the first-order equations about
    level hover (`heli3dof.model.physics.rigid_body`). Other effects act as on the rigid body. The
    effect `geometry` then tests whether the recordings need the rigid body instead.
    """
    out[LINEAR] = 1.0


def rigid_body(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Blend of the linear hover model and the rigid body: q̈ = (1 − a) q̈_hover + a q̈_rigid.

    q̈ are the angular accelerations of roll r, pitch p, yaw ψ. The parameter a is 0 for the hover
    model and 1 for the complete rigid body (`heli3dof.model.physics.rigid_body`). Their torques are

    =====  =======================  ==================================================
    axis   hover model              rigid body
    =====  =======================  ==================================================
    roll   L_a F − T_g              L_a cos p F − T_g cos r + G_p sin r sin p
    pitch  L_h D − G_p              L_h D − G_p cos r cos p
    yaw    −T_g p + G_p r           −L_a cos r sin p F + L_h sin r D
    =====  =======================  ==================================================

    F and D (N) are the sum and the difference of the two thrusts. The thrusts act at the distance
    L_a from the yaw axis and ±L_h from the body's centre. T_g and G_p are the gravity torques of
    the level arm and the level body. The rigid body also has Coriolis and centrifugal torques, and
    its inertias depend on the angles. The hover model has constant inertias.

    A score test at a = 0 shows whether recordings need the rigid body. In a model with this effect,
    a has the prior N(1, 0.2²) (`heli3dof.model.effects.base.share`).
    """
    out[LINEAR] *= 1.0 - par[A]


def uncoupled(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Simplified equations, without the axes' inertia couplings: q̈ = (1 − κ) q̈_rigid + κ q̈_alone.

    q̈_rigid are the angular accelerations of the complete rigid body. There, the inertia of the bar
    that carries the motors couples the axes (`heli3dof.model.physics.rigid_body`). q̈_alone are the
    accelerations from one equation per axis, without these couplings. Such simpler equations are
    common in the literature. The parameter κ of this effect is 0 if all couplings are kept, 1 if
    they are omitted. The largest omitted torque is −J_p sin r ψ̈ on pitch, up to 0.01 N·m. J_p is
    the pitch inertia, r the roll angle, ψ the yaw angle.

    A real rig has the couplings; a simulated rig may lack them. This choice of equations is no
    defect. So a diagnosis may estimate κ, but does not report it as a finding. The prior of κ is
    N(1, 0.2²) (`heli3dof.model.effects.base.share`).
    """
    out[UNCOUPLED] = par[A]


def without_rate_products(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Equations without products of rates: no centrifugal and Coriolis torques.

    The effect multiplies the following torques by 1 − μ:

        −J_r sin r cos r ψ̇²                     on roll r
        J_p sin p cos p (ṙ² − cos² r ψ̇²)        on pitch p
        2 (J_ψ − J_p) sin r cos r ṙ ψ̇           on yaw ψ

    The effect's parameter μ is 0 if the torques are kept, 1 if they are omitted. J_r, J_p, J_ψ are
    the inertias about the three axes (`heli3dof.model.physics.rigid_body`). This effect is for
    models with the effect ``simplified.couplings``. A diagnosis does not report it as a finding.
    """
    out[WITHOUT_RATE_PRODUCTS] = par[A]


def with_side_thrust(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Yaw torque η L_h D sin r of the thrusts on a tilted rig, added to simplified equations.

    D = F_f − F_b (N) is the difference of front and back thrust, r the roll angle. L_h (m) is the
    distance from the body's axis to a motor. In the complete rigid body, the inertia coupling
    J_p sin r p̈ cancels most of this torque, because the pitch acceleration p̈ is nearly proportional
    to D (`heli3dof.model.physics.rigid_body`); J_p is the pitch inertia. Simplified equations have
    no such coupling. They either omit the torque or contain all of it. The effect's parameter η is
    0 if the torque is omitted, 1 if all of it is kept. This effect is for models with the effect
    ``simplified.couplings``. A diagnosis does not report it as a finding.
    """
    out[SIDE_THRUST] = par[A]


def constant_yaw_inertia(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Equations in which the yaw inertia is constant: J_ψ instead of J_ψ(r), with roll angle r.

    J_ψ and J_p are the yaw and pitch inertias of the level rig. At the roll angle r, the yaw
    inertia of the rigid body is J_ψ(r) = (J_ψ − J_p) cos² r + J_p. At r = 15° it is 7 % below J_ψ.
    Its change with roll causes the yaw torque 2 (J_ψ − J_p) sin r cos r ṙ ψ̇, where ψ is yaw
    (`heli3dof.model.physics.rigid_body`). The effect's parameter ν is 0 if J_ψ(r) and this torque
    are kept. It is 1 if J_ψ replaces J_ψ(r) and the torque is omitted. A diagnosis does not report
    this choice of equations as a finding.
    """
    out[CONSTANT_YAW_INERTIA] = par[A]


EFFECTS = (
    Effect(
        name="base.hover",
        summary="The base is the paper's hover model, linear about level hover; a switch, "
        "no finding.",
        parameters=(),
        hooks={Stage.SETUP: hover},
        separated_by="large",
        identifiable="chosen by --base hover, not estimated",
        evidence="roll",
    ),
    Effect(
        name="geometry",
        summary="The rigid body in place of the paper's hover model (with `--base hover`).",
        parameters=(share("a, of the rigid body; 1 all of it"),),
        hooks={Stage.SETUP: rigid_body},
        order=1,
        confused_with=("stiffness.pendulum", "aero.ground_effect"),
        separated_by="large",
        identifiable="flight 5° or more from level, or with the thrust varied while tilted",
        evidence="roll",
        within="base.hover",
    ),
    Effect(
        name="simplified.couplings",
        summary="Inertia couplings are omitted, as in the simplified equations.",
        parameters=(share("κ, of what is omitted; 1 all of it"),),
        hooks={Stage.SETUP: uncoupled},
        confused_with=("stiffness.pendulum",),
        separated_by="large",
        identifiable="pitch and roll off level together",
        evidence="pitch",
        formal=True,
    ),
    Effect(
        name="simplified.rates",
        summary="Products of rates are omitted, as in the simplest equations.",
        parameters=(share("μ; 1 all of it"),),
        hooks={Stage.SETUP: without_rate_products},
        confused_with=("inertia.product",),
        separated_by="large",
        identifiable="fast yaw with roll off level",
        evidence="yaw_rate",
        within="simplified.couplings",
        formal=True,
    ),
    Effect(
        name="simplified.side_thrust",
        summary="The thrust difference turns a tilted rig, with couplings omitted.",
        parameters=(share("η; 1 all of it"),),
        hooks={Stage.SETUP: with_side_thrust},
        confused_with=("aero.reaction_torque",),
        separated_by="large",
        identifiable="pitch moved fast with roll off level",
        evidence="voltage_difference",
        within="simplified.couplings",
        formal=True,
    ),
    Effect(
        name="simplified.yaw_inertia",
        summary="The inertia about the vertical is constant, as in the simplified equations.",
        parameters=(share("ν, of what is omitted; 1 all of it"),),
        hooks={Stage.SETUP: constant_yaw_inertia},
        confused_with=("inertia",),
        separated_by="large",
        identifiable="yaw at several roll angles, 10° apart or more",
        evidence="roll",
        formal=True,
    ),
)
