/* The hardware layer that a board implements. No function may wait. */
#ifndef HELI3DOF_HAL_H
#define HELI3DOF_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "device.h"

/* Microseconds since any moment; monotonic, never wraps. */
uint64_t hal_now_us(void);

/* Bytes of the link: read those that have arrived, write those that fit. Both return the number. */
size_t hal_read(uint8_t *bytes, size_t room);
size_t hal_write(const uint8_t *bytes, size_t n);

/* Counts, currents, fault, stall and button, latched together at the last time of hal_now_us: a
 * sample carries them with that time. */
void hal_inputs(struct device_inputs *inputs);

/* The amplifier: its enable line, and microvolts at the front and back motor. Disabled is
 * called with zeros. Also called with unchanged values. */
void hal_output(bool enabled, const int32_t uV[2]);

#endif
