/* The frames of protocol 1 (docs/reference/protocol.md), byte by byte, with explicit little-endian
 * access.
 *
 *     payload = version u8, type u8, number u32, body, crc16 u16, crc16 in reverse order u16
 */
#ifndef HELI3DOF_FRAMES_H
#define HELI3DOF_FRAMES_H

#include <stddef.h>
#include <stdint.h>

#define FRAME_VERSION 1u
#define FRAME_HEADER 6u
#define FRAME_CHECK 4u
#define FRAME_LONGEST 128u      /* bytes between two delimiters at most */
#define FRAME_LONGEST_OUT 98u   /* IDENTITY, with its delimiter */
#define FRAME_TEXT 16u
#define NOT_MEASURED INT16_MIN  /* a current that the device does not measure */

enum frame_type {
    HELLO = 0x01,
    ARM = 0x02,
    COMMAND = 0x03,
    POLL = 0x04,
    DISARM = 0x05,
    ESTOP = 0x06,
    STATUS = 0x07,
    IDENTITY = 0x81,
    ACK = 0x82,
    SAMPLE = 0x83,
    REPORT = 0x87
};

enum flag {
    FLAG_ENABLED = 1,
    FLAG_FAULT = 2,
    FLAG_STALL = 4,
    FLAG_LATCHED = 8,
    FLAG_STOPPED = 16,
    FLAG_SATURATED = 32
};

enum cause {
    CAUSE_NONE,
    CAUSE_WATCHDOG,
    CAUSE_HOST_ESTOP,
    CAUSE_BUTTON,
    CAUSE_OVERCURRENT,
    CAUSE_OVERTEMPERATURE,
    CAUSE_STALL,
    CAUSE_ENCODER,
    CAUSE_SUPPLY,
    CAUSE_SATURATED
};

enum code { OK, ALREADY_ARMED, STALE_TICKET, FAULT, BAD_PARAMETER, UNKNOWN_TYPE, VERSION };

/* What the bytes between two delimiters are. */
enum verdict {
    FRAME_MALFORMED, /* COBS, length, version or check wrong */
    FRAME_UNKNOWN, /* valid, of an unknown type */
    FRAME_TAKEN /* valid, of a known type */
};

/* A received frame; the type determines the used fields. */
struct request {
    uint8_t type;
    uint32_t number;
    uint8_t oldest, newest;                  /* HELLO: protocol versions that the host supports */
    uint32_t ticket, period_us, watchdog_us; /* ARM */
    int32_t uV[2];                           /* COMMAND: front, back */
    uint8_t reason;                          /* ESTOP */
};

struct identity {
    uint8_t version, flags;
    uint32_t boot, ticket;
    int32_t counts[3]; /* per revolution; negative where the count falls as the angle rises */
    uint32_t v_max_uV, watchdog_us, ramp_us, shortest_us;
    const char *model, *serial, *firmware; /* ASCII; at most 16 characters are sent */
};

struct ack {
    uint8_t request, code, flags, cause;
    uint32_t ticket;
};

struct sample {
    uint32_t echo, time_us;
    int32_t counts[3];
    int32_t uV[2];
    int16_t mA[2];
    uint16_t delay_us;
    uint8_t flags, cause;
};

struct report {
    uint32_t frames, malformed, refused, expiries, late_us, encoder_errors, uptime_ms;
    uint8_t flags, cause;
    uint32_t ticket;
};

/* Decodes `piece` in place (n bytes, at most FRAME_LONGEST) and parses it. */
enum verdict frame_read(uint8_t *piece, size_t n, struct request *request);

/* Each writes a whole frame with its delimiter to `out` (FRAME_LONGEST_OUT bytes are enough) and
 * returns its length. */
size_t frame_identity(uint8_t *out, uint32_t number, const struct identity *identity);
size_t frame_ack(uint8_t *out, uint32_t number, const struct ack *ack);
size_t frame_sample(uint8_t *out, uint32_t number, const struct sample *sample);
size_t frame_report(uint8_t *out, uint32_t number, const struct report *report);

#endif
