/* The device of docs/reference/protocol.md as a state machine. It uses no hardware, no heap and no floating
 * point, and never waits. The caller gives the time.
 *
 *     IDLE --ARM--> ARMED --watchdog expires----> LATCHED     ESTOP, fault, stall, button,
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
#define STREAM_SILENCE_US 2000000u /* us without a frame from the host: then the stream ends */

struct device_config {
    uint32_t boot;   /* changes with every start */
    uint32_t ticket; /* the first one */
    int32_t counts[3]; /* per revolution */
    uint32_t v_max_uV, watchdog_us, ramp_us, shortest_us;
    const char *model, *serial, *firmware;
};

/* The hardware's inputs. */
struct device_inputs {
    int32_t counts[3]; /* since the start */
    uint32_t encoder_errors;
    int16_t mA[2];     /* motor currents, or NOT_MEASURED */
    uint8_t fault;     /* the amplifier's: an enum cause, or 0 */
    bool stall, button;
};

enum device_state { IDLE, ARMED, LATCHED, STOPPED };

struct device {
    struct device_config config;
    struct device_inputs inputs;
    enum device_state state;
    uint8_t cause, stop_flag; /* cause and flag of an output held at zero */
    uint32_t ticket;

    int32_t set_uV[2]; /* the last accepted command, clipped */
    bool saturated;
    uint32_t echo; /* number of the last accepted command, or of the ARM */
    uint64_t command_us, watchdog_us; /* time of that command or ARM; timeout */

    uint64_t period_us; /* 0: no stream */
    uint64_t next_us;   /* the stream's next instant */
    uint64_t sampled_us;
    uint32_t samples; /* taken since the start, or the last arming */
    bool fresh; /* a command came since the last sample */

    uint64_t start_us, heard_us;
    uint32_t frames, malformed, refused, expiries, late_us;
    struct link_in in;
    struct link_out out;
};

/* Sets output zero and IDLE. Call it at the start and after a reset. The texts of `config` are not
 * copied and must stay valid. */
void device_start(struct device *device, const struct device_config *config, uint64_t now_us);

/* Takes the hardware's inputs, then ticks. A new fault, stall or button press stops at once. */
void device_sense(struct device *device, uint64_t now_us, const struct device_inputs *inputs);

/* Advances watchdog and stream to this time. Call it at least every millisecond. */
void device_tick(struct device *device, uint64_t now_us);

/* Ticks, then takes bytes from the host and queues the replies in `out`. */
void device_receive(struct device *device, uint64_t now_us, const uint8_t *bytes, size_t n);

/* Stops for a reason outside the link: USB's control request, a lost bus. */
void device_stop(struct device *device, uint8_t cause);

/* Returns when the next sample is due or the watchdog expires, whichever is earlier: call
 * device_tick then. UINT64_MAX: neither. */
uint64_t device_next_us(const struct device *device);

/* Writes the voltages at this time to uV; returns false where the amplifier is to be disabled. */
bool device_output(const struct device *device, uint64_t now_us, int32_t uV[2]);

uint8_t device_flags(const struct device *device);

#endif
