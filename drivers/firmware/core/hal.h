/* The thin hardware layer: what a board must supply. Nothing here may wait. */
#ifndef HELI3DOF_HAL_H
#define HELI3DOF_HAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "device.h"

/* Microseconds since any moment; never goes back, never wraps. */
uint64_t hal_now_us(void);

/* Bytes of the link: those that have come, those that fit now. Both return how many. */
size_t hal_read(uint8_t *bytes, size_t room);
size_t hal_write(const uint8_t *bytes, size_t n);

/* Counts, currents, fault, stall, button, latched together, at the time that hal_now_us told last:
 * a sample says that these are the counts of then. */
void hal_inputs(struct device_inputs *inputs);

/* The amplifier: its enable line, and microvolts at the front and back motor. Disabled comes with
 * zeros. Also called with what is out already. */
void hal_output(bool enabled, const int32_t uV[2]);

#endif
