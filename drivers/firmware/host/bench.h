/* The bench behind the HAL: the plant, encoders on its axes, and the drills that disturb them. */
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
    double armed_s;   /* the first arming: drills count from here */
};

void bench_start(struct bench *bench, const struct options *options, double t_s);

/* Lets time pass under the voltages that are out. */
void bench_advance(struct bench *bench, double t_s);

/* Where the encoders' counters begin at zero: the device starts again. */
void bench_reset_counters(struct bench *bench);

/* Whether `after` seconds from the first arming lie behind t_s. */
bool bench_due(const struct bench *bench, double t_s, double after_s);

void bench_inputs(const struct bench *bench, struct device_inputs *inputs);

#endif
