/* Runs the core on a virtual clock: `heli3dof-replay` reads lines
 *
 *     100 > 0401010701…   these bytes arrive at 100 us
 *     900 .               the clock advances to 900 us
 *
 * and prints the replies of the golden transcripts' device, one frame per line: `100 < 0401…`.
 *
 * `heli3dof-replay --pieces` reads bytes as hexadecimal lines and prints, for each piece between
 * delimiters, `taken` or `unknown` and its payload, or `malformed`.
 *
 * `heli3dof-replay --plant` reads angles, rates and voltages, `r p psi dr dp dpsi V_f V_b`, and
 * prints the bench plant's angular accelerations; SI. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "device.h"
#include "plant.h"

static const struct device_config GOLDEN = {
    .boot = 1,
    .ticket = 1,
    .counts = {4096, 4096, 8192},
    .v_max_uV = 24000000,
    .watchdog_us = 100000,
    .ramp_us = 200000,
    .shortest_us = 500,
    .model = "golden device",
    .serial = "G1",
    .firmware = "1.0",
};

static struct device device;

static void print_answers(uint64_t now_us)
{
    const uint8_t *at;
    size_t n;
    bool begun = false;
    while ((n = link_out_peek(&device.out, &at)) > 0) {
        for (size_t i = 0; i < n; i++) {
            if (!begun)
                printf("%" PRIu64 " < ", now_us);
            printf("%02x", at[i]);
            begun = at[i] != 0;
            if (!begun)
                putchar('\n');
        }
        link_out_sent(&device.out, n);
    }
}

static void advance(uint64_t now_us)
{
    for (uint64_t next; (next = device_next_us(&device)) <= now_us;) {
        device_tick(&device, next);
        print_answers(next);
    }
    device_tick(&device, now_us);
    print_answers(now_us);
}

static char line[1 << 20];

static void pieces(void)
{
    struct link_in in = {.n = 0};
    struct request request;
    size_t n;
    while (fgets(line, sizeof line, stdin)) {
        const char *rest = line;
        for (unsigned byte; sscanf(rest, "%2x", &byte) == 1; rest += 2) {
            if (!link_in_byte(&in, (uint8_t)byte, &n))
                continue;
            const enum verdict verdict = frame_read(in.piece, n, &request);
            fputs(verdict == FRAME_TAKEN     ? "taken "
                  : verdict == FRAME_UNKNOWN ? "unknown "
                                             : "malformed",
                  stdout);
            for (size_t i = 0; verdict != FRAME_MALFORMED && i + 1 < n; i++)
                printf("%02x", in.piece[i]);
            putchar('\n');
        }
    }
}

static void accelerations(void)
{
    double q[3], dq[3], V[2], ddq[3];
    while (scanf("%lf %lf %lf %lf %lf %lf %lf %lf", &q[0], &q[1], &q[2], &dq[0], &dq[1], &dq[2],
                 &V[0], &V[1]) == 8) {
        plant_acceleration(q, dq, V, ddq);
        printf("%.17g %.17g %.17g\n", ddq[0], ddq[1], ddq[2]);
    }
}

int main(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "--plant") == 0) {
        accelerations();
        return 0;
    }
    if (argc > 1 && strcmp(argv[1], "--pieces") == 0) {
        pieces();
        return 0;
    }
    device_start(&device, &GOLDEN, 0);
    while (fgets(line, sizeof line, stdin)) {
        uint64_t now_us;
        int used = 0;
        if (sscanf(line, "%" SCNu64 " %n", &now_us, &used) < 1)
            continue;
        const char *rest = line + used;
        if (*rest == '!') { /* the device paused until now */
            device_tick(&device, now_us);
            print_answers(now_us);
            continue;
        }
        advance(now_us);
        if (*rest != '>')
            continue;
        rest += strspn(rest, "> ");
        for (unsigned byte; sscanf(rest, "%2x", &byte) == 1; rest += 2) {
            const uint8_t one = (uint8_t)byte;
            device_receive(&device, now_us, &one, 1);
            print_answers(now_us);
        }
    }
    return 0;
}
