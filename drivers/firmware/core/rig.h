/* The device on its hardware: one turn of a board's main loop. */
#ifndef HELI3DOF_RIG_H
#define HELI3DOF_RIG_H

#include "device.h"

/* Call first after a start or a reset: zero volts, amplifier disabled, IDLE. */
void rig_start(struct device *device, const struct device_config *config);

/* Reads inputs and link, advances the device, sets the output, sends. Call it when bytes have
 * arrived, at device_next_us, and at least every millisecond. */
void rig_turn(struct device *device);

#endif
