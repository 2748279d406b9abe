/* Tests what the golden transcripts do not cover: counting, COBS, faults, lost time, the plant.
 * Prints each test's name; the first that fails ends the program. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cobs.h"
#include "crc16.h"
#include "device.h"
#include "encoder.h"
#include "plant.h"

static const uint8_t FORWARDS[4] = {0, 2, 3, 1}; /* A leads B */
static struct device device;
static const struct device_config CONFIG = {
    .boot = 1,
    .ticket = 1,
    .counts = {4096, 4096, 8192},
    .v_max_uV = 24000000,
    .watchdog_us = 100000,
    .ramp_us = 200000,
    .shortest_us = 500,
    .model = "unit",
    .serial = "a serial of more than sixteen",
    .firmware = "1.0",
};
static const struct device_inputs STILL = {.mA = {NOT_MEASURED, NOT_MEASURED}};

/* ---- checks, stuffing, counting ---------------------------------------------------------- */

static void the_crc_of_the_nine_digits_is_the_published_one(void)
{
    assert(crc16((const uint8_t *)"123456789", 9) == 0x29B1);
    assert(crc16_backwards((const uint8_t *)"987654321", 9) == 0x29B1);
    assert(crc16(NULL, 0) == 0xFFFF);
}

static void stuffing_is_the_papers_and_comes_back(void)
{
    static const uint8_t PAYLOAD[] = {0, 0, 1, 2, 0, 3};
    static const uint8_t STUFFED[] = {1, 1, 3, 1, 2, 2, 3};
    uint8_t out[260], back[260];
    assert(cobs_encode(PAYLOAD, 6, out) == 7 && memcmp(out, STUFFED, 7) == 0);
    assert(cobs_decode(out, 7, back) == 6 && memcmp(back, PAYLOAD, 6) == 0);
    assert(cobs_decode(out, 7, out) == 6 && memcmp(out, PAYLOAD, 6) == 0);
    assert(cobs_encode(PAYLOAD, 0, out) == 1 && out[0] == 1);
    assert(cobs_decode(PAYLOAD, 0, out) == COBS_BAD);
    assert(cobs_decode((const uint8_t *)"\x05" "abc", 4, out) == COBS_BAD);
}

static void a_turn_forwards_counts_four_and_back_again(void)
{
    struct encoder e;
    encoder_start(&e, 0);
    for (int i = 1; i <= 4; i++)
        encoder_step(&e, FORWARDS[i % 4]);
    assert(encoder_count(&e) == 4);
    for (int i = 3; i >= -6; i--)
        encoder_step(&e, FORWARDS[i & 3]);
    assert(encoder_count(&e) == -6 && e.errors == 0);
}

static void an_impossible_step_is_an_error_and_no_count(void)
{
    struct encoder e;
    encoder_start(&e, 1);
    encoder_step(&e, 2);
    encoder_step(&e, 2);
    assert(encoder_count(&e) == 0 && e.errors == 1);
    encoder_step(&e, 3); /* counting continues from the lines' state */
    assert(encoder_count(&e) == 1);
}

/* ---- the device -------------------------------------------------------------------------- */

static size_t host_says(uint64_t now_us, uint8_t type, uint32_t number, const void *body, size_t n)
{
    uint8_t payload[64] = {FRAME_VERSION, type, (uint8_t)number, (uint8_t)(number >> 8)};
    uint8_t stuffed[80];
    if (n)
        memcpy(payload + FRAME_HEADER, body, n);
    n += FRAME_HEADER;
    const uint16_t c = crc16(payload, n), back = crc16_backwards(payload, n);
    const uint8_t check[4] = {(uint8_t)c, (uint8_t)(c >> 8), (uint8_t)back, (uint8_t)(back >> 8)};
    memcpy(payload + n, check, 4);
    n = cobs_encode(payload, n + 4, stuffed);
    stuffed[n++] = 0;
    const uint32_t before = device.out.head;
    device_receive(&device, now_us, stuffed, n);
    return device.out.head - before;
}

static size_t arm(uint64_t now_us, uint32_t period_us)
{
    const uint8_t body[12] = {(uint8_t)device.ticket, 0, 0, 0, (uint8_t)period_us,
                              (uint8_t)(period_us >> 8)};
    return host_says(now_us, ARM, 0, body, 12);
}

static void command_one_volt(uint64_t now_us, uint32_t number)
{
    static const uint8_t ONE_VOLT[8] = {0x40, 0x42, 0x0F, 0, 0xC0, 0xBD, 0xF0, 0xFF};
    host_says(now_us, COMMAND, number, ONE_VOLT, 8);
}

static int32_t out_uV(uint64_t now_us)
{
    int32_t uV[2];
    const bool enabled = device_output(&device, now_us, uV);
    assert(enabled || (uV[0] == 0 && uV[1] == 0));
    assert(uV[0] == -uV[1]);
    return uV[0];
}

static void armed_at_one_volt(uint32_t period_us)
{
    device_start(&device, &CONFIG, 0);
    assert(arm(1000, period_us) == 20 + 48);
    command_one_volt(2000, 1);
    assert(device.state == ARMED && out_uV(2000) == 1000000);
}

static void a_fault_a_stall_and_the_button_stop_from_every_state_and_say_why(void)
{
    const struct {
        struct device_inputs inputs;
        uint8_t cause, flags;
    } cases[] = {
        {{.fault = CAUSE_OVERTEMPERATURE}, CAUSE_OVERTEMPERATURE, FLAG_FAULT},
        {{.stall = true}, CAUSE_STALL, FLAG_STALL},
        {{.button = true}, CAUSE_BUTTON, FLAG_STOPPED},
    };
    for (int i = 0; i < 3; i++) {
        for (enum device_state from = IDLE; from <= STOPPED; from++) {
            armed_at_one_volt(0);
            device.state = from;
            const uint32_t ticket = device.ticket;
            device_sense(&device, 3000, &cases[i].inputs);
            assert(device.state == STOPPED && out_uV(3000) == 0 && device.ticket != ticket);
            assert(device.cause == cases[i].cause && device_flags(&device) == cases[i].flags);
        }
    }
}

static void no_arming_while_the_fault_lasts_and_arming_after_it(void)
{
    const struct device_inputs fault = {.fault = CAUSE_OVERCURRENT};
    armed_at_one_volt(0);
    device_sense(&device, 3000, &fault);
    assert(arm(4000, 0) == 20 && device.state == STOPPED && device.cause == CAUSE_OVERCURRENT);
    device_sense(&device, 5000, &STILL);
    assert(device.state == STOPPED && device_flags(&device) == FLAG_FAULT); /* kept until armed */
    assert(arm(6000, 0) == 68 && device.state == ARMED && device.cause == CAUSE_NONE);
}

static void a_line_that_is_up_at_the_start_stops_too(void)
{
    const struct device_inputs button = {.button = true};
    device_start(&device, &CONFIG, 0);
    device_sense(&device, 1, &button);
    assert(device.state == STOPPED && device.cause == CAUSE_BUTTON);
}

static void a_stop_from_another_input_sends_no_answer(void)
{
    armed_at_one_volt(0);
    const uint32_t head = device.out.head;
    device_stop(&device, CAUSE_SUPPLY);
    assert(device.state == STOPPED && device.cause == CAUSE_SUPPLY && out_uV(2001) == 0);
    assert(device.out.head == head);
}

static void the_ramp_begins_at_the_expiry_however_late_the_tick_is(void)
{
    armed_at_one_volt(0);
    device_tick(&device, 102000);
    assert(device.state == ARMED && out_uV(102000) == 1000000);
    device_tick(&device, 152000);
    assert(device.state == LATCHED && out_uV(152000) == 750000);
    assert(out_uV(301999) == 5 && out_uV(302000) == 0 && out_uV(400000) == 0);
}

static void disarming_on_the_ramp_disables_the_amplifier(void)
{
    int32_t uV[2];
    armed_at_one_volt(0);
    device_tick(&device, 152000);
    host_says(152000, DISARM, 9, NULL, 0);
    assert(device.state == LATCHED && !device_output(&device, 152001, uV));
}

static void a_device_held_up_leaves_samples_out_and_never_sends_a_burst(void)
{
    armed_at_one_volt(2000);
    uint32_t head = device.out.head;
    device_tick(&device, 1000 + 5 * 2000 + 300);
    assert(device.out.head - head == 48 && device.samples == 2 && device.late_us == 8300);
    head = device.out.head;
    device_tick(&device, 12999);
    assert(device.out.head == head);
    device_tick(&device, 13000);
    assert(device.out.head - head == 48 && device.samples == 3);
}

/* The previous turn may have been long ago. */
static void a_sample_carries_the_counts_and_lines_of_its_own_time(void)
{
    const struct device_inputs moved = {.counts = {77, 0, 0}, .fault = CAUSE_OVERCURRENT};
    uint8_t sample[64];
    const uint8_t *at;
    armed_at_one_volt(2000);
    device.out.tail = device.out.head = 0;
    device_sense(&device, 43000, &moved);
    assert(cobs_decode(device.out.ring, link_out_peek(&device.out, &at) - 1, sample) == 46);
    const uint32_t time_us = sample[FRAME_HEADER + 4] | (uint32_t)sample[FRAME_HEADER + 5] << 8;
    assert(time_us == 43000 && sample[FRAME_HEADER + 8] == 77);
    assert(sample[FRAME_HEADER + 34] == FLAG_FAULT);
}

static void a_stream_that_nobody_answers_ends_after_two_seconds(void)
{
    armed_at_one_volt(10000);
    uint64_t last_us = 0;
    for (uint64_t now = 2000; now < 3000000; now += 1000) {
        const uint32_t head = device.out.head;
        device_tick(&device, now);
        if (device.out.head != head)
            last_us = now;
        device.out.tail = device.out.head;
    }
    assert(last_us == 2001000 && device.period_us == 0 && device.state == LATCHED);
    assert(host_says(3000000, POLL, 9, NULL, 0) == 48);
}

static void a_host_that_does_not_read_loses_whole_frames(void)
{
    armed_at_one_volt(0);
    device.out.tail = device.out.head;
    for (uint32_t i = 0; i < 100; i++)
        host_says(3000, POLL, i, NULL, 0);
    assert(device.out.head - device.out.tail == (LINK_OUT - LINK_SPARE) / 48 * 48);
    assert(device.out.dropped == 100 - (LINK_OUT - LINK_SPARE) / 48);
    assert(host_says(3000, STATUS, 1, NULL, 0) == 46); /* a reply still fits */
}

static void the_devices_own_frames_coming_back_are_not_answered(void)
{
    static const uint8_t ACK_BODY[8] = {0};
    device_start(&device, &CONFIG, 0);
    assert(host_says(10, ACK, 3, ACK_BODY, 8) == 0 && device.refused == 1);
    assert(host_says(20, 0x66, 3, ACK_BODY, 5) == 20 && device.refused == 2);
}

/* ---- the bench plant --------------------------------------------------------------------- */

/* Inertias by hand: point masses 1.87 kg at 0.4699 m, 1.15 kg at 0.6604 m; bar 0.03635 kg m^2. */
static void at_hover_the_plant_is_the_papers(void)
{
    const double zero[3] = {0, 0, 0}, tilt[3] = {0, 1e-6, 0};
    const double hover[2] = {7.456, 7.456}, up[2] = {8.456, 8.456}, front[2] = {8.456, 7.456};
    double a[3];
    plant_acceleration(zero, zero, hover, a);
    assert(fabs(a[ROLL]) < 1e-12 && fabs(a[PITCH]) < 1e-12 && fabs(a[YAW]) < 1e-12);
    plant_acceleration(zero, zero, up, a);
    assert(fabs(a[ROLL] - 2 * 0.6604 * 0.1188 / 0.91445) < 1e-4);
    plant_acceleration(zero, zero, front, a);
    assert(fabs(a[PITCH] - 0.5810) < 1e-4);
    plant_acceleration(tilt, zero, hover, a);
    assert(fabs(a[YAW] / 1e-6 + 1.2304) < 1e-3);
}

/* The fictitious torques at 2 rad/s of yaw are large. */
static void spinning_the_arm_is_pulled_level_and_the_bar_upright_to_it(void)
{
    const double q[3] = {0.3, 0.2, 1.0}, dq[3] = {0, 0, 2.0}, none[2] = {0, 0};
    double still[3], spun[3];
    const double rest[3] = {0, 0, 0};
    plant_acceleration(q, rest, none, still);
    plant_acceleration(q, dq, none, spun);
    assert(spun[ROLL] - still[ROLL] < -0.9); /* about -sin r cos r dpsi^2 = -1.13 */
    assert(spun[PITCH] - still[PITCH] < -0.5); /* about -sin p cos p cos^2 r dpsi^2 = -0.71 */
}

static void on_the_table_it_stays_and_from_hover_voltage_it_does_not_sink(void)
{
    const double none[2] = {0, 0}, more[2] = {9, 9};
    struct plant plant;
    plant_start(&plant, 0);
    plant_advance(&plant, 2, none);
    assert(fabs(plant.q[ROLL] * 180 / 3.14159265358979 + 27.5) < 1e-9 && plant.dq[ROLL] == 0);
    plant_advance(&plant, 60, more);
    assert(plant.q[ROLL] <= 36.001 / 57.29578 && plant.q[PITCH] == 0);
}

#define HOLDS(statement) (statement(), puts(#statement))

int main(void)
{
    HOLDS(the_crc_of_the_nine_digits_is_the_published_one);
    HOLDS(stuffing_is_the_papers_and_comes_back);
    HOLDS(a_turn_forwards_counts_four_and_back_again);
    HOLDS(an_impossible_step_is_an_error_and_no_count);
    HOLDS(a_fault_a_stall_and_the_button_stop_from_every_state_and_say_why);
    HOLDS(no_arming_while_the_fault_lasts_and_arming_after_it);
    HOLDS(a_line_that_is_up_at_the_start_stops_too);
    HOLDS(a_stop_from_another_input_sends_no_answer);
    HOLDS(the_ramp_begins_at_the_expiry_however_late_the_tick_is);
    HOLDS(disarming_on_the_ramp_disables_the_amplifier);
    HOLDS(a_device_held_up_leaves_samples_out_and_never_sends_a_burst);
    HOLDS(a_sample_carries_the_counts_and_lines_of_its_own_time);
    HOLDS(a_stream_that_nobody_answers_ends_after_two_seconds);
    HOLDS(a_host_that_does_not_read_loses_whole_frames);
    HOLDS(the_devices_own_frames_coming_back_are_not_answered);
    HOLDS(at_hover_the_plant_is_the_papers);
    HOLDS(spinning_the_arm_is_pulled_level_and_the_bar_upright_to_it);
    HOLDS(on_the_table_it_stays_and_from_hover_voltage_it_does_not_sink);
    return 0;
}
