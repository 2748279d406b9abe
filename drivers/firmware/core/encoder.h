/* Quadrature decoding, four counts per line: A leading B counts up.
 *
 *     A B   00 -> 10 -> 11 -> 01 -> 00   +1 each; in reverse -1
 *
 * If both lines change at once, a step was missed or there was noise. The direction is unknown, so
 * the count stays and an error is counted. Call encoder_step from the pins'
 * interrupt; a board that counts in hardware does not need it. */
#ifndef HELI3DOF_ENCODER_H
#define HELI3DOF_ENCODER_H

#include <stdint.h>

struct encoder {
    uint32_t count;  /* modulo 2^32; read it with encoder_count */
    uint32_t errors; /* invalid steps */
    uint8_t lines;   /* the last state, A << 1 | B */
};

/* `lines`: the present state, A << 1 | B. encoder_start also sets count and errors to zero. */
void encoder_start(struct encoder *encoder, uint8_t lines);
void encoder_step(struct encoder *encoder, uint8_t lines);
int32_t encoder_count(const struct encoder *encoder);

#endif
