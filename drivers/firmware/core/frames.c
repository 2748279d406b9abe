#include "frames.h"

#include <stdbool.h>

#include "cobs.h"
#include "crc16.h"

/* ---- bytes in -------------------------------------------------------------------------- */

static uint16_t get16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (at[1] << 8));
}

static uint32_t get32(const uint8_t *at)
{
    return (uint32_t)at[0] | ((uint32_t)at[1] << 8) | ((uint32_t)at[2] << 16) |
           ((uint32_t)at[3] << 24);
}

/* Two's complement without implementation-defined conversion. */
static int32_t get_signed(const uint8_t *at)
{
    const uint32_t u = get32(at);
    return u < 0x80000000u ? (int32_t)u : (int32_t)(u - 0x80000000u) + INT32_MIN;
}

/* Bytes of a body; -1 for an unknown type. */
static int body_length(uint8_t type)
{
    switch (type) {
    case HELLO: return 2;
    case ARM: return 12;
    case COMMAND: return 8;
    case POLL:
    case DISARM:
    case STATUS: return 0;
    case ESTOP: return 1;
    case IDENTITY: return 86;
    case ACK: return 8;
    case SAMPLE: return 36;
    case REPORT: return 34;
    default: return -1;
    }
}

static bool check_right(const uint8_t *data, size_t n)
{
    const size_t covered = n - FRAME_CHECK;
    return get16(data + covered) == crc16(data, covered) &&
           get16(data + covered + 2) == crc16_backwards(data, covered);
}

enum verdict frame_read(uint8_t *piece, size_t n, struct request *request)
{
    const size_t length = n <= FRAME_LONGEST ? cobs_decode(piece, n, piece) : COBS_BAD;
    if (length == COBS_BAD || length < FRAME_HEADER + FRAME_CHECK)
        return FRAME_MALFORMED;
    if (piece[0] != FRAME_VERSION && piece[1] != HELLO)
        return FRAME_MALFORMED;
    if (!check_right(piece, length))
        return FRAME_MALFORMED;

    const uint8_t *body = piece + FRAME_HEADER;
    const int expected = body_length(piece[1]);
    *request = (struct request){.type = piece[1], .number = get32(piece + 2)};
    if (expected < 0)
        return FRAME_UNKNOWN;
    if (length != FRAME_HEADER + (size_t)expected + FRAME_CHECK)
        return FRAME_MALFORMED;
    switch (request->type) {
    case HELLO:
        request->oldest = body[0];
        request->newest = body[1];
        break;
    case ARM:
        request->ticket = get32(body);
        request->period_us = get32(body + 4);
        request->watchdog_us = get32(body + 8);
        break;
    case COMMAND:
        request->uV[0] = get_signed(body);
        request->uV[1] = get_signed(body + 4);
        break;
    case ESTOP:
        request->reason = body[0];
        break;
    default:
        break;
    }
    return FRAME_TAKEN;
}

/* ---- bytes out ------------------------------------------------------------------------- */

struct payload {
    size_t n;
    uint8_t bytes[FRAME_LONGEST_OUT];
};

static void put8(struct payload *p, uint8_t value)
{
    p->bytes[p->n++] = value;
}

static void put16(struct payload *p, uint16_t value)
{
    put8(p, (uint8_t)(value & 0xFF));
    put8(p, (uint8_t)(value >> 8));
}

static void put32(struct payload *p, uint32_t value)
{
    put16(p, (uint16_t)(value & 0xFFFF));
    put16(p, (uint16_t)(value >> 16));
}

static void put_text(struct payload *p, const char *text)
{
    for (size_t i = 0; i < FRAME_TEXT; i++)
        put8(p, *text ? (uint8_t)*text++ : 0);
}

static void begin(struct payload *p, enum frame_type type, uint32_t number)
{
    p->n = 0;
    put8(p, FRAME_VERSION);
    put8(p, (uint8_t)type);
    put32(p, number);
}

static size_t finish(struct payload *p, uint8_t *out)
{
    const uint16_t forwards = crc16(p->bytes, p->n);
    const uint16_t backwards = crc16_backwards(p->bytes, p->n);
    put16(p, forwards);
    put16(p, backwards);
    const size_t n = cobs_encode(p->bytes, p->n, out);
    out[n] = 0;
    return n + 1;
}

size_t frame_identity(uint8_t *out, uint32_t number, const struct identity *identity)
{
    struct payload p;
    begin(&p, IDENTITY, number);
    put8(&p, identity->version);
    put8(&p, identity->flags);
    put32(&p, identity->boot);
    put32(&p, identity->ticket);
    for (int i = 0; i < 3; i++)
        put32(&p, (uint32_t)identity->counts[i]);
    put32(&p, identity->v_max_uV);
    put32(&p, identity->watchdog_us);
    put32(&p, identity->ramp_us);
    put32(&p, identity->shortest_us);
    put_text(&p, identity->model);
    put_text(&p, identity->serial);
    put_text(&p, identity->firmware);
    return finish(&p, out);
}

size_t frame_ack(uint8_t *out, uint32_t number, const struct ack *ack)
{
    struct payload p;
    begin(&p, ACK, number);
    put8(&p, ack->request);
    put8(&p, ack->code);
    put8(&p, ack->flags);
    put8(&p, ack->cause);
    put32(&p, ack->ticket);
    return finish(&p, out);
}

size_t frame_sample(uint8_t *out, uint32_t number, const struct sample *sample)
{
    struct payload p;
    begin(&p, SAMPLE, number);
    put32(&p, sample->echo);
    put32(&p, sample->time_us);
    for (int i = 0; i < 3; i++)
        put32(&p, (uint32_t)sample->counts[i]);
    for (int i = 0; i < 2; i++)
        put32(&p, (uint32_t)sample->uV[i]);
    for (int i = 0; i < 2; i++)
        put16(&p, (uint16_t)sample->mA[i]);
    put16(&p, sample->delay_us);
    put8(&p, sample->flags);
    put8(&p, sample->cause);
    return finish(&p, out);
}

size_t frame_report(uint8_t *out, uint32_t number, const struct report *report)
{
    struct payload p;
    begin(&p, REPORT, number);
    put32(&p, report->frames);
    put32(&p, report->malformed);
    put32(&p, report->refused);
    put32(&p, report->expiries);
    put32(&p, report->late_us);
    put32(&p, report->encoder_errors);
    put32(&p, report->uptime_ms);
    put8(&p, report->flags);
    put8(&p, report->cause);
    put32(&p, report->ticket);
    return finish(&p, out);
}
