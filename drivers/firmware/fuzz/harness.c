/* Runs the core with arbitrary bytes and times. At every step the harness checks that
 *
 *  1. the output is zero unless ARMED by an ARM with the current ticket, or on the ramp after it;
 *  2. |output| <= v_max, always;
 *  3. after watchdog + ramp without an accepted command: zero, amplifier disabled;
 *  4. after a received ESTOP, a fault, a stall or the button: zero at once;
 *  5. frames + malformed never exceeds the pieces; refused never exceeds frames; every reply is a
 *     valid frame for the core's own parser.
 *
 * The input is a program: operation bytes with arguments. Some operations send frames with correct
 * checks, as random input would almost never pass the check. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cobs.h"
#include "crc16.h"
#include "device.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const struct device_config CONFIG = {
    .boot = 7,
    .ticket = 0xFFFFFFF0u,
    .counts = {4096, -4096, 8192},
    .v_max_uV = 24000000,
    .watchdog_us = 100000,
    .ramp_us = 200000,
    .shortest_us = 500,
    .model = "fuzzed",
    .serial = "F1",
    .firmware = "1.0",
};

static struct device device;
static struct device_inputs inputs;
static uint64_t now_us;

/* The harness's own state. */
static uint64_t pieces;        /* delimiters sent: an upper bound of the frames */
static uint64_t alive_us;      /* the last time at which a voltage may have been set */
static uint64_t watchdog_us;   /* the longest that may be set */
static bool may_have_volts;    /* an ARM with the current ticket was sent since the last stop */
static struct link_in host_in; /* the host's receiver */

static void must(bool holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "does not hold: %s\n", what);
        abort();
    }
}

struct cursor {
    const uint8_t *at, *end;
};

static uint8_t next8(struct cursor *c)
{
    return c->at < c->end ? *c->at++ : 0;
}

static uint32_t next32(struct cursor *c)
{
    uint32_t value = 0;
    for (int i = 0; i < 4; i++)
        value = value << 8 | next8(c);
    return value;
}

static void check_output(void)
{
    int32_t uV[2];
    const bool enabled = device_output(&device, now_us, uV);
    const int32_t most = (int32_t)CONFIG.v_max_uV;
    for (int i = 0; i < 2; i++) {
        must(uV[i] >= -most && uV[i] <= most, "2: within v_max");
        must(enabled || uV[i] == 0, "disabled means zero");
        must(may_have_volts || uV[i] == 0, "1, 4: volts without a right ARM, or after a stop");
        must(now_us <= alive_us + watchdog_us + CONFIG.ramp_us || uV[i] == 0, "3: silence");
    }
    must(may_have_volts || !enabled, "1: enabled without a right ARM");
    must(device.state != STOPPED || !enabled, "4: stopped");
    must(device.state != IDLE || !enabled, "idle");
    must(now_us <= alive_us + watchdog_us + CONFIG.ramp_us || !enabled, "3: disabled");
    must((device_flags(&device) & 0xC0) == 0, "flags 64 and 128 are zero");
    must((uint64_t)device.frames + device.malformed <= pieces, "5: frames and malformed");
    must(device.refused <= device.frames, "5: refused");
    must(device.state == IDLE || device.state == ARMED || device.cause || device.stop_flag,
         "held at zero for a cause");
}

static void hear(void)
{
    struct request answer;
    const uint8_t *at;
    size_t n, length;
    must(device.out.head - device.out.tail <= LINK_OUT, "the ring holds what it can");
    while ((n = link_out_peek(&device.out, &at)) > 0) {
        for (size_t i = 0; i < n; i++) {
            if (link_in_byte(&host_in, at[i], &length))
                must(frame_read(host_in.piece, length, &answer) == FRAME_TAKEN &&
                         answer.type & 0x80,
                     "5: answers are whole");
        }
        link_out_sent(&device.out, n);
    }
}

static void say(const uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i < n; i++)
        pieces += bytes[i] == 0;
    device_receive(&device, now_us, bytes, n);
}

/* Sends a frame with a correct check, of any length. */
static void say_payload(uint8_t payload[64], size_t n)
{
    uint8_t stuffed[72] = {0};
    const uint16_t c = crc16(payload, n), back = crc16_backwards(payload, n);
    payload[n] = (uint8_t)c;
    payload[n + 1] = (uint8_t)(c >> 8);
    payload[n + 2] = (uint8_t)back;
    payload[n + 3] = (uint8_t)(back >> 8);
    n = cobs_encode(payload, n + 4, stuffed + 1); /* also with a delimiter before it */
    stuffed[n + 1] = 0;
    say(stuffed, n + 2);
}

static void say_frame(uint8_t type, uint32_t number, const uint8_t *body, size_t n)
{
    uint8_t payload[64] = {FRAME_VERSION, type};
    for (unsigned i = 0; i < 4; i++)
        payload[2 + i] = (uint8_t)(number >> 8 * i);
    memcpy(payload + FRAME_HEADER, body, n);
    say_payload(payload, FRAME_HEADER + n);
}

static void say_anything_with_a_check(struct cursor *c)
{
    uint8_t payload[64] = {next8(c)};
    const size_t n = next8(c) & 31u;
    for (size_t i = 1; i < n; i++)
        payload[i] = next8(c);
    if (n >= FRAME_HEADER && payload[0] == FRAME_VERSION && payload[1] <= STATUS)
        return; /* other operations send those, and know the expected result */
    const uint32_t frames = device.frames;
    say_payload(payload, n);
    must(n >= FRAME_HEADER || device.frames == frames, "what is shorter than a frame is none");
}

static void le32(uint8_t *at, uint32_t value)
{
    for (unsigned i = 0; i < 4; i++)
        at[i] = (uint8_t)(value >> 8 * i);
}

static void say_arm(struct cursor *c)
{
    static const uint32_t PERIODS[8] = {0, 0, 500, 2000, 499, 60000, 600000, 0xFFFFFFFFu};
    static const uint32_t WATCHDOGS[8] = {0, 0, 1, 4000, 100000, 1000000, 1000001, 0xFFFFFFFFu};
    const uint8_t choice = next8(c);
    const uint32_t ticket = choice & 0x80 ? next32(c) : device.ticket;
    const bool right = ticket == device.ticket && device.state != ARMED;
    const uint32_t watchdog = WATCHDOGS[choice >> 3 & 7];
    uint8_t body[12];
    le32(body, ticket);
    le32(body + 4, PERIODS[choice & 7]);
    le32(body + 8, watchdog);
    if (right && !inputs.fault && !inputs.stall && !inputs.button) {
        may_have_volts = true;
        watchdog_us = watchdog > CONFIG.watchdog_us ? watchdog : CONFIG.watchdog_us;
        if (watchdog_us > WATCHDOG_LONGEST_US)
            watchdog_us = WATCHDOG_LONGEST_US;
        alive_us = now_us;
    }
    say_frame(ARM, next32(c), body, sizeof body);
}

static void say_command(struct cursor *c)
{
    const uint8_t choice = next8(c);
    const uint32_t number = choice & 0x80 ? next32(c) : device.echo + (choice & 3u);
    const bool accepted = device.state == ARMED && number != device.echo &&
                          number - device.echo < 0x80000000u;
    uint8_t body[8];
    le32(body, next32(c));
    le32(body + 4, next32(c));
    device_tick(&device, now_us);
    const bool due = accepted && device.state == ARMED;
    const uint32_t before = device.echo;
    if (due)
        alive_us = now_us;
    say_frame(COMMAND, number, body, sizeof body);
    must(device.echo == (due ? number : before), "a stale or repeated command does nothing");
}

/* Sends raw bytes. They may contain a valid frame, so the voltages are checked against the commands
 * that the core reports as accepted. */
static void say_noise(struct cursor *c)
{
    struct request request;
    const size_t n = next8(c);
    const uint32_t echo = device.echo, ticket = device.ticket;
    uint8_t *noise = malloc(n + 1); /* on the heap: a sanitizer detects the first byte beyond */
    if (!noise)
        return;
    for (size_t i = 0; i < n; i++)
        noise[i] = next8(c);
    say(noise, n);
    noise = realloc(noise, n ? n : 1);
    if (n && noise)
        frame_read(noise, n, &request);
    free(noise);
    if (device.echo != echo || device.ticket != ticket)
        alive_us = now_us;
    if (device.state == ARMED)
        may_have_volts = true;
}

static void stopped(void)
{
    must(device.state == STOPPED, "4: stopped");
    may_have_volts = false;
}

static void turn_lines(uint8_t choice)
{
    const struct device_inputs before = inputs;
    inputs.fault = choice & 1 ? CAUSE_OVERCURRENT : 0;
    inputs.stall = choice & 2;
    inputs.button = choice & 4;
    inputs.encoder_errors += choice >> 6;
    inputs.counts[choice >> 4 & 1] = (int32_t)choice - 128;
    device_sense(&device, now_us, &inputs);
    if ((inputs.fault && !before.fault) || (inputs.stall && !before.stall) ||
        (inputs.button && !before.button))
        stopped();
}

static void operate(struct cursor *c)
{
    static const uint32_t STEPS[8] = {0, 1, 499, 2000, 50000, 100001, 300001, 2000001};
    const uint8_t operation = next8(c);
    uint8_t body[8] = {0};
    switch (operation & 15) {
    case 0: now_us += STEPS[next8(c) & 7]; break;
    case 1: now_us += next32(c); break;
    case 2: say_arm(c); break;
    case 3:
    case 4: say_command(c); break;
    case 5: say_noise(c); break;
    case 6: say_frame(POLL, next32(c), body, 0); break;
    case 7: say_frame(STATUS, next32(c), body, 0); break;
    case 8:
        body[0] = next8(c);
        body[1] = next8(c);
        say_frame(HELLO, next32(c), body, 2);
        break;
    case 9:
        say_frame(DISARM, next32(c), body, 0);
        must(device.state != ARMED, "disarmed");
        may_have_volts = false;
        break;
    case 10:
        body[0] = next8(c);
        say_frame(ESTOP, next32(c), body, 1);
        stopped();
        break;
    case 11: turn_lines(next8(c)); break;
    case 12:
        device_stop(&device, CAUSE_SUPPLY);
        stopped();
        break;
    case 13: say_anything_with_a_check(c); break;
    case 14: hear(); break;
    default: device_tick(&device, now_us); break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct cursor c = {data, data + size};
    now_us = 1000;
    pieces = 0;
    may_have_volts = false;
    alive_us = now_us;
    watchdog_us = CONFIG.watchdog_us;
    inputs = (struct device_inputs){.mA = {NOT_MEASURED, 100}};
    host_in = (struct link_in){.n = 0};
    device_start(&device, &CONFIG, now_us);
    while (c.at < c.end) {
        operate(&c);
        device_tick(&device, now_us);
        check_output();
    }
    hear();
    return 0;
}
