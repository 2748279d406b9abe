/* A line that delays every byte by the same time. */
#ifndef HELI3DOF_DELAY_H
#define HELI3DOF_DELAY_H

#include <stddef.h>
#include <stdint.h>

#define DELAY_ROOM 65536u /* bytes on the way at once: 25 ms at 2.6 MB/s; more are lost */

struct delay {
    uint64_t arrives_us[DELAY_ROOM];
    uint8_t bytes[DELAY_ROOM];
    uint32_t head, tail;
};

void delay_put(struct delay *delay, uint64_t arrives_us, uint8_t byte);

/* Writes the bytes that have arrived by now to `bytes`, at most `room`; returns how many. */
size_t delay_get(struct delay *delay, uint64_t now_us, uint8_t *bytes, size_t room);

/* Returns when the next byte arrives; UINT64_MAX where none is on the way. */
uint64_t delay_next_us(const struct delay *delay);

#endif
