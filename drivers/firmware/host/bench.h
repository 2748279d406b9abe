/* The simulated rig behind the HAL: the plant, its encoders, and drills (faults at set times). */
#ifndef HELI3DOF_BENCH_H
#define HELI3DOF_BENCH_H

#include <stdbool.h>

#include "device.h"
#include "encoder.h"
#include "options.h"
#include "plant.h"

struct bench {
    const struct options *options;
    struct plant plant;
    struct encoder encoders[3];
    long turned[3];   /* counts that the axis has turned; the encoder follows by single steps */
    double V[2];      /* at the motors */
    double armed_s;   /* the first arming, from which the times of drills count */
};

void bench_start(struct bench *bench, const struct options *options, double t_s);

/* Advances the plant to t_s under the present voltages. */
void bench_advance(struct bench *bench, double t_s);

/* The device restarts: the counts restart from zero. */
void bench_reset_counters(struct bench *bench);

/* Returns true if t_s is at least after_s seconds after the first arming. */
bool bench_due(const struct bench *bench, double t_s, double after_s);

void bench_inputs(const struct bench *bench, struct device_inputs *inputs);

#endif
