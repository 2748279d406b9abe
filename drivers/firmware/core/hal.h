/* The hardware layer that a board implements. No function may wait. */
#ifndef HELI3DOF_HAL_H
#define HELI3DOF_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "device.h"

/* Returns microseconds since an arbitrary moment; monotonic, without wrapping. */
uint64_t hal_now_us(void);

/* Read the link's bytes that have arrived, write those that fit. Both return the number. */
size_t hal_read(uint8_t *bytes, size_t room);
size_t hal_write(const uint8_t *bytes, size_t n);

/* Reads counts, currents, fault, stall and button, all at the time of the last hal_now_us: a sample
 * carries them with that time. */
void hal_inputs(struct device_inputs *inputs);

/* Sets the amplifier: its enable line, and microvolts at the front and back motor, which are zero
 * if it is disabled. It is also called with unchanged values. */
void hal_output(bool enabled, const int32_t uV[2]);

#endif
