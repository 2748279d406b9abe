/* The plant: a 3-DOF helicopter as three point masses on a bar on an arm, by Newton and Euler
 * with Kane's projection, no small angles.
 *
 *     roll r: the arm, up +       pitch p: the body, front up +      yaw psi: the arm, CCW +
 *
 *     u, t, n   along the arm, horizontally across it, upwards across both
 *     b = t cos p + n sin p       the body's bar;  f = n cos p - t sin p  the thrust's direction
 *     x_w = -L_w u      x_f = L_a u + L_h b      x_b = L_a u - L_h b
 *
 *     sum_i m_i (d x_i / d q_j) . a_i = Q_j       for q = r, p, psi
 *
 * Q: the thrusts K_f V f at x_f and x_b; on roll -T_g cos r with T_g = 2 L_a K_f V_o (the gravity
 * torque is calibrated, docs/explanation/paper.md, E2, and does not follow from the masses); light damping.
 * The arm rests on the table at -27.5 degrees; all stops are inelastic. */
#ifndef HELI3DOF_PLANT_H
#define HELI3DOF_PLANT_H

enum axis { ROLL, PITCH, YAW };

struct plant {
    double q[3];  /* rad */
    double dq[3]; /* rad/s */
    double t_s;
};

/* Sets the plant at rest on the table. */
void plant_start(struct plant *plant, double t_s);

/* Integrates until t_s under constant voltages (V: front, back). */
void plant_advance(struct plant *plant, double t_s, const double V[2]);

/* Writes the angular accelerations, rad/s^2, to ddq. */
void plant_acceleration(const double q[3], const double dq[3], const double V[2], double ddq[3]);

#endif
