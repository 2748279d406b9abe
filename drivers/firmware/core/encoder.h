/* Quadrature counting, times four: A leading B counts up.
 *
 *     A B   00 -> 10 -> 11 -> 01 -> 00   +1 each; the other way round -1
 *
 * Both lines changing at once is a step that was missed or noise: it is counted as an error and
 * moves nothing, for nobody knows which way. Call from the pins' interrupt, or where the board
 * counts in hardware, not at all. */
#ifndef HELI3DOF_ENCODER_H
#define HELI3DOF_ENCODER_H

#include <stdint.h>

struct encoder {
    uint32_t count;  /* modulo 2^32; read it with encoder_count */
    uint32_t errors; /* impossible steps */
    uint8_t lines;   /* the last state, A << 1 | B */
};

void encoder_start(struct encoder *encoder, uint8_t lines);
void encoder_step(struct encoder *encoder, uint8_t lines);
int32_t encoder_count(const struct encoder *encoder);

#endif
