/* The device of docs/reference/protocol.md as a state machine: no hardware, no memory from the heap, no
 * floating point, nothing that waits. Whoever calls it says what time it is.
 *
 *     IDLE --ARM--> ARMED --silence > watchdog--> LATCHED     ESTOP, fault, stall, button,
 *      ^             | ^                            | |       device_stop: from every state
 *      +---DISARM----+ +-------------ARM------------+ |       to STOPPED; out of it by ARM
 *
 * Times are microseconds of one clock that never goes back; voltages microvolts, currents
 * milliamperes. Index 0 is the front motor, 1 the back; axes are roll, pitch, yaw. */
#ifndef HELI3DOF_DEVICE_H
#define HELI3DOF_DEVICE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frames.h"
#include "link.h"

#define WATCHDOG_LONGEST_US 1000000u
#define STREAM_UNHEARD_US 2000000u /* a stream that nobody answers ends */

struct device_config {
    uint32_t boot;   /* different after every start */
    uint32_t ticket; /* the first one */
    int32_t counts[3];
    uint32_t v_max_uV, watchdog_us, ramp_us, shortest_us;
    const char *model, *serial, *firmware;
};

/* What the hardware says now. */
struct device_inputs {
    int32_t counts[3]; /* since the start */
    uint32_t encoder_errors;
    int16_t mA[2];     /* NOT_MEASURED where it is not */
    uint8_t fault;     /* the amplifier's: an enum cause, or 0 */
    bool stall, button;
};

enum device_state { IDLE, ARMED, LATCHED, STOPPED };

struct device {
    struct device_config config;
    struct device_inputs inputs;
    enum device_state state;
    uint8_t cause, stop_flag; /* why, and as what, the output is held at zero */
    uint32_t ticket;

    int32_t set_uV[2]; /* the last accepted command, clipped */
    bool saturated;
    uint32_t echo; /* number of the last accepted command, or of the ARM */
    uint64_t command_us, watchdog_us;

    uint64_t period_us; /* 0: no stream */
    uint64_t next_us;   /* the stream's next instant */
    uint64_t sampled_us;
    uint32_t samples; /* made since the start, or the arming */
    bool fresh; /* a command came since the last sample */

    uint64_t start_us, heard_us;
    uint32_t frames, damaged, refused, expiries, late_us;
    struct link_in in;
    struct link_out out;
};

/* Also after a reset: output zero, IDLE. `config` is copied, its texts are not. */
void device_start(struct device *device, const struct device_config *config, uint64_t now_us);

/* The hardware's lines; a fault, a stall or the button stops at once. */
void device_sense(struct device *device, uint64_t now_us, const struct device_inputs *inputs);

/* What time alone does: the watchdog, the stream. Call it at least every millisecond. */
void device_tick(struct device *device, uint64_t now_us);

/* Bytes from the host, as they came. Ticks first. */
void device_receive(struct device *device, uint64_t now_us, const uint8_t *bytes, size_t n);

/* Stop by another door than the link: USB's control request, a bus that was lost. */
void device_stop(struct device *device, uint8_t cause);

/* When device_tick has something to do that cannot wait for the next millisecond. */
uint64_t device_next_us(const struct device *device);

/* What goes to the motors at this time; false where the amplifier is to be disabled. */
bool device_output(const struct device *device, uint64_t now_us, int32_t uV[2]);

uint8_t device_flags(const struct device *device);

#endif
