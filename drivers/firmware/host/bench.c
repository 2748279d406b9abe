#include "bench.h"

#include <math.h>

#define PI 3.14159265358979323846
#define OHM 6.0 /* resistance of a motor, turning or blocked: 4 A at 24 V */

/* Returns the lines A, B after `counts` counts: 00, 10, 11, 01, cyclic. */
static uint8_t lines_at(long counts)
{
    static const uint8_t GRAY[4] = {0, 2, 3, 1};
    return GRAY[(unsigned long)counts & 3u];
}

/* Passes every edge to the encoder in order, until it has `counts` counts. */
static void turn(struct bench *bench, int axis, long counts)
{
    long *at = &bench->turned[axis];
    while (*at != counts) {
        *at += *at < counts ? 1 : -1;
        encoder_step(&bench->encoders[axis], lines_at(*at));
    }
}

static long counts_of(const struct bench *bench, int axis)
{
    const double per_rad = bench->options->counts[axis] / (2 * PI);
    return lround(floor(bench->plant.q[axis] * per_rad + 0.5));
}

void bench_reset_counters(struct bench *bench)
{
    for (int i = 0; i < 3; i++)
        encoder_start(&bench->encoders[i], lines_at(bench->turned[i]));
}

void bench_start(struct bench *bench, const struct options *options, double t_s)
{
    *bench = (struct bench){.options = options, .armed_s = NEVER};
    plant_start(&bench->plant, t_s);
    for (int i = 0; i < 3; i++)
        bench->turned[i] = counts_of(bench, i);
    bench_reset_counters(bench);
}

bool bench_due(const struct bench *bench, double t_s, double after_s)
{
    return t_s - bench->armed_s >= after_s;
}

void bench_advance(struct bench *bench, double t_s)
{
    const struct options *o = bench->options;
    plant_advance(&bench->plant, t_s, bench->V);
    for (int i = 0; i < 3; i++) {
        const bool frozen = i == (int)o->freeze_axis && bench_due(bench, t_s, o->freeze_s);
        const bool off = i == (int)o->jump_axis && bench_due(bench, t_s, o->jump_s);
        if (!frozen)
            turn(bench, i, counts_of(bench, i) + (off ? o->jump_counts : 0));
    }
}

static bool during(const struct bench *bench, double from_s, double for_s)
{
    const double t_s = bench->plant.t_s;
    return bench_due(bench, t_s, from_s) && !bench_due(bench, t_s, from_s + for_s);
}

void bench_inputs(const struct bench *bench, struct device_inputs *inputs)
{
    const struct options *o = bench->options;
    *inputs = (struct device_inputs){
        .fault = during(bench, o->fault_s, o->fault_for_s) ? CAUSE_OVERCURRENT : 0,
        .stall = during(bench, o->stall_s, o->stall_for_s),
        .button = during(bench, o->button_s, 0.1),
    };
    for (int i = 0; i < 3; i++) {
        inputs->counts[i] = encoder_count(&bench->encoders[i]);
        inputs->encoder_errors += bench->encoders[i].errors;
    }
    for (int i = 0; i < 2; i++)
        inputs->mA[i] = (int16_t)lround(1e3 * bench->V[i] / OHM);
}
