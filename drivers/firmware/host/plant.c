#include "plant.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
#define DEG (PI / 180.0)

/* Table I with rows 14 and 15 corrected. m, kg, N/V, V */
#define L_W 0.4699
#define L_A 0.6604
#define L_H 0.1778
#define M_W 1.87
#define M_H 0.575
#define K_F 0.1188
#define V_O 7.456

static const double DAMPING[3] = {0.05, 0.004, 0.05}; /* N m s/rad */
static const double LOWEST[3] = {-27.5 * DEG, -32.0 * DEG, -HUGE_VAL};
static const double HIGHEST[3] = {36.0 * DEG, 32.0 * DEG, HUGE_VAL};
static const double STEP_s = 1e-3;

typedef struct {
    double x, y, z;
} vec;

static vec sum(double a, vec u, double b, vec v)
{
    return (vec){a * u.x + b * v.x, a * u.y + b * v.y, a * u.z + b * v.z};
}

static vec cross(vec u, vec v)
{
    return (vec){u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}

static double dot(vec u, vec v)
{
    return u.x * v.x + u.y * v.y + u.z * v.z;
}

/* A point mass. Its acceleration is linear in ddq: a = sum_j (d x / d q_j) ddq_j + a at ddq = 0. */
struct point {
    double mass;
    vec along[3]; /* d x / d q_j, m/rad */
    vec left;     /* a at ddq = 0, m/s^2 */
};

static void solve3(double A[3][4], double x[3])
{
    for (int i = 0; i < 3; i++) { /* positive definite: no pivoting */
        for (int k = i + 1; k < 3; k++) {
            const double f = A[k][i] / A[i][i];
            for (int j = i; j < 4; j++)
                A[k][j] -= f * A[i][j];
        }
    }
    for (int i = 2; i >= 0; i--) {
        x[i] = A[i][3];
        for (int j = i + 1; j < 3; j++)
            x[i] -= A[i][j] * x[j];
        x[i] /= A[i][i];
    }
}

void plant_acceleration(const double q[3], const double dq[3], const double V[2], double ddq[3])
{
    /* Vectors in the frame that turns with yaw, x axis below the arm. Nothing depends on psi. */
    const double cr = cos(q[ROLL]), sr = sin(q[ROLL]);
    const double cp = cos(q[PITCH]), sp = sin(q[PITCH]);
    const vec z = {0, 0, 1}, t = {0, 1, 0};
    const vec u = {cr, 0, sr}, n = {-sr, 0, cr};
    const vec b = sum(cp, t, sp, n), f = sum(cp, n, -sp, t);

    /* Arm: w = dpsi z - dr t; body: w + dp u. Their derivatives at ddq = 0 come from t turning
     * with yaw and u turning with the arm. */
    const vec w_arm = sum(dq[YAW], z, -dq[ROLL], t);
    const vec w_body = sum(1, w_arm, dq[PITCH], u);
    const vec dw_arm = sum(-dq[ROLL] * dq[YAW], cross(z, t), 0, z);
    const vec dw_body = sum(1, dw_arm, dq[PITCH], cross(w_arm, u));

    struct point points[3];
    const double on_arm[3] = {-L_W, L_A, L_A}, on_bar[3] = {0, L_H, -L_H};
    for (int i = 0; i < 3; i++) {
        const vec arm = sum(on_arm[i], u, 0, u), bar = sum(on_bar[i], b, 0, b);
        const vec swing = sum(1, cross(dw_arm, arm), 1, cross(w_arm, cross(w_arm, arm)));
        const vec tilt = sum(1, cross(dw_body, bar), 1, cross(w_body, cross(w_body, bar)));
        const vec out = sum(1, arm, 1, bar);
        points[i].mass = i == 0 ? M_W : M_H;
        points[i].along[ROLL] = cross(out, t); /* -t x out */
        points[i].along[PITCH] = cross(u, bar);
        points[i].along[YAW] = cross(z, out);
        points[i].left = sum(1, swing, 1, tilt);
    }

    double A[3][4];
    const double gravity[3] = {-2 * L_A * K_F * V_O * cr, 0, 0};
    for (int j = 0; j < 3; j++) {
        A[j][3] = gravity[j] - DAMPING[j] * dq[j];
        for (int i = 0; i < 3; i++)
            A[j][3] -= points[i].mass * dot(points[i].along[j], points[i].left);
        for (int i = 0; i < 2; i++)
            A[j][3] += K_F * V[i] * dot(points[1 + i].along[j], f);
        for (int k = 0; k < 3; k++) {
            A[j][k] = 0;
            for (int i = 0; i < 3; i++)
                A[j][k] += points[i].mass * dot(points[i].along[j], points[i].along[k]);
        }
    }
    solve3(A, ddq);
}

static void derivative(const double x[6], const double V[2], double dx[6])
{
    memcpy(dx, x + 3, 3 * sizeof *dx);
    plant_acceleration(x, x + 3, V, dx + 3);
}

/* One step of the classical Runge-Kutta method of fourth order. */
static void runge_kutta(double x[6], double h, const double V[2])
{
    double k[4][6], y[6];
    derivative(x, V, k[0]);
    for (int s = 1; s < 4; s++) {
        const double part = s == 3 ? h : h / 2;
        for (int i = 0; i < 6; i++)
            y[i] = x[i] + part * k[s - 1][i];
        derivative(y, V, k[s]);
    }
    for (int i = 0; i < 6; i++)
        x[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
}

/* A stop is inelastic: it limits the angle and removes the outward speed. */
static void stops(double x[6])
{
    for (int i = 0; i < 3; i++) {
        if (x[i] <= LOWEST[i]) {
            x[i] = LOWEST[i];
            x[3 + i] = fmax(x[3 + i], 0);
        } else if (x[i] >= HIGHEST[i]) {
            x[i] = HIGHEST[i];
            x[3 + i] = fmin(x[3 + i], 0);
        }
    }
}

void plant_start(struct plant *plant, double t_s)
{
    *plant = (struct plant){.q = {LOWEST[ROLL], 0, 0}, .t_s = t_s};
}

void plant_advance(struct plant *plant, double t_s, const double V[2])
{
    double x[6];
    memcpy(x, plant->q, sizeof plant->q);
    memcpy(x + 3, plant->dq, sizeof plant->dq);
    while (plant->t_s < t_s) {
        const double h = fmin(t_s - plant->t_s, STEP_s);
        runge_kutta(x, h, V);
        stops(x);
        plant->t_s += h;
    }
    memcpy(plant->q, x, sizeof plant->q);
    memcpy(plant->dq, x + 3, sizeof plant->dq);
}
