/* heli3dof-rig: the core on a PTY in real time, with a simulated helicopter. This file has the host's
 * HAL and main loop. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "bench.h"
#include "delay.h"
#include "hal.h"
#include "pty.h"
#include "rig.h"
#include "tcp.h"

#define REAL_TIME_PRIORITY 80 /* the computer's load must not delay the device */
#define TURN_US 1000u
#define MOTION_S 5e-3
#define LATE_US 200u /* a sample written longer after its taking is late; a turn: 10 us */

static struct options options;
static struct bench bench;
static struct device device;
static int line = -1, listener = -1, log_file = -1, late_file = -1, motion_file = -1;
static volatile sig_atomic_t ended;
static struct delay there, back;

/* ---- HAL ------------------------------------------------------------------------------- */

static double monotonic_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static uint64_t now_us; /* the last time given to the core */

uint64_t hal_now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    now_us = (uint64_t)t.tv_sec * 1000000u + (uint64_t)t.tv_nsec / 1000u;
    return now_us;
}

static uint32_t noise = 1;

static bool happens(double probability)
{
    noise ^= noise << 13; /* Marsaglia's xorshift32 */
    noise ^= noise >> 17;
    noise ^= noise << 5;
    return noise < probability * 4294967296.0;
}

static uint8_t on_the_way(uint8_t byte)
{
    const unsigned bit = happens(options.corrupt) ? 1u << (noise >> 8 & 7u) : 0u;
    return (uint8_t)(byte ^ bit);
}

static uint64_t after_delay_us(void)
{
    return hal_now_us() + (uint64_t)(1e6 * options.delay_s);
}

size_t hal_read(uint8_t *bytes, size_t room)
{
    size_t n = 0, kept = 0;
    const uint64_t told_us = now_us;
    if (listener < 0)
        n = pty_read(line, bytes, room);
    else if (line >= 0 || (line = tcp_accept(listener)) >= 0)
        n = tcp_read(&line, bytes, room);
    for (size_t i = 0; i < n; i++) {
        if (!happens(options.drop))
            bytes[kept++] = on_the_way(bytes[i]);
    }
    if (options.delay_s <= 0)
        return kept;
    for (size_t i = 0; i < kept; i++)
        delay_put(&there, after_delay_us(), bytes[i]);
    now_us = told_us;
    return delay_get(&there, told_us, bytes, room);
}

/* Send the delayed bytes that are due to the host. */
static void deliver(void)
{
    uint8_t byte;
    while (delay_get(&back, hal_now_us(), &byte, 1) == 1) {
        if (line >= 0)
            pty_write(line, &byte, 1);
    }
}

static size_t write_now(const uint8_t *bytes, size_t n)
{
    size_t sent = 0;
    if (options.drop <= 0 && options.corrupt <= 0)
        return pty_write(line, bytes, n);
    for (; sent < n; sent++) {
        const uint8_t byte = on_the_way(bytes[sent]);
        if (!happens(options.drop) && pty_write(line, &byte, 1) == 0)
            break;
    }
    return sent;
}

size_t hal_write(const uint8_t *bytes, size_t n)
{
    if (line < 0)
        return n; /* no host */
    if (options.delay_s <= 0)
        return write_now(bytes, n);
    for (size_t i = 0; i < n; i++) {
        if (!happens(options.drop))
            delay_put(&back, after_delay_us(), on_the_way(bytes[i]));
    }
    return n;
}

void hal_inputs(struct device_inputs *inputs)
{
    /* Advance to the sample's time: this process may have been held up since. */
    bench_advance(&bench, 1e-6 * (double)now_us);
    bench_inputs(&bench, inputs);
}

void hal_output(bool enabled, const int32_t uV[2])
{
    static int32_t out_uV[2];
    static bool out_enabled;
    static bool written;
    if (written && enabled == out_enabled && uV[0] == out_uV[0] && uV[1] == out_uV[1])
        return;
    written = true;
    out_enabled = enabled;
    for (int i = 0; i < 2; i++) {
        out_uV[i] = uV[i];
        bench.V[i] = 1e-6 * uV[i];
    }
    if (log_file >= 0) {
        char text[96];
        const int n = snprintf(text, sizeof text, "%.6f %d %.6f %.6f\n", monotonic_s(), enabled,
                               bench.V[0], bench.V[1]);
        if (write(log_file, text, (size_t)n) < 0)
            log_file = -1; /* a full disk must not stop the rig */
    }
}

/* ---- the program ----------------------------------------------------------------------- */

static void end(int signal_number)
{
    (void)signal_number;
    ended = 1;
}

static uint32_t any_u32(void)
{
    uint32_t value;
    return getrandom(&value, sizeof value, 0) == (ssize_t)sizeof value ? value
                                                                       : (uint32_t)hal_now_us();
}

static void start(void)
{
    const struct device_config config = {
        .boot = options.boot_given ? options.boot : any_u32(),
        .ticket = any_u32(),
        .counts = {options.counts[0], options.counts[1], options.counts[2]},
        .v_max_uV = 24000000,
        .watchdog_us = options.watchdog_us,
        .ramp_us = options.ramp_us,
        .shortest_us = options.shortest_us,
        .model = "emulated bench",
        .serial = options.serial,
        .firmware = "c 1.0",
    };
    rig_start(&device, &config);
}

/* Requests real-time scheduling, where permitted: a loaded machine would delay the device. */
static void real_time(void)
{
    const struct sched_param priority = {.sched_priority = REAL_TIME_PRIORITY};
    prctl(PR_SET_TIMERSLACK, 1ul);
    if (sched_setscheduler(0, SCHED_FIFO, &priority) == 0)
        mlockall(MCL_CURRENT | MCL_FUTURE);
}

static void wait_for_host_or_time(void)
{
    const uint8_t *at;
    const uint64_t at_us = hal_now_us();
    uint64_t next_us = device_next_us(&device);
    if (delay_next_us(&there) < next_us)
        next_us = delay_next_us(&there);
    if (delay_next_us(&back) < next_us)
        next_us = delay_next_us(&back);
    const uint64_t until_us = next_us < at_us + TURN_US ? next_us : at_us + TURN_US;
    const uint64_t left_us = until_us > at_us ? until_us - at_us : 0;
    const struct timespec left = {0, (long)left_us * 1000};
    struct pollfd ready = {line >= 0 ? line : listener, POLLIN, 0};
    if (link_out_peek(&device.out, &at) > 0)
        ready.events |= POLLOUT;
    ppoll(&ready, 1, &left, NULL);
}

static int opened(const char *option, const char *path)
{
    const int file = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    if (file < 0) {
        fprintf(stderr, "heli3dof-rig: %s %s: %s\n", option, path, strerror(errno));
        exit(2);
    }
    return file;
}

/* Logs a sample that was taken in this turn and written late. */
static void log_late(uint64_t sampled_before_us)
{
    const uint64_t took_us = hal_now_us() - device.sampled_us;
    char text[48];
    if (late_file < 0 || device.sampled_us == sampled_before_us || took_us <= LATE_US)
        return;
    const int n = snprintf(text, sizeof text, "%u %u\n", (unsigned)(uint32_t)device.sampled_us,
                           (unsigned)took_us);
    if (write(late_file, text, (size_t)n) < 0)
        late_file = -1;
}

/* Logs the arm's present position, even if the host gets no sample. */
static void log_motion(void)
{
    static double written_s;
    const double t_s = bench.plant.t_s;
    char text[80];
    if (motion_file < 0 || t_s - written_s < MOTION_S)
        return;
    written_s = t_s;
    const int n = snprintf(text, sizeof text, "%.6f %.6f %.6f\n", t_s, bench.plant.q[ROLL],
                           bench.plant.dq[ROLL]);
    if (write(motion_file, text, (size_t)n) < 0)
        motion_file = -1;
}

static void open_port_and_logs(void)
{
    char path[64];
    if (options.tcp >= 0)
        listener = tcp_listen((uint16_t)options.tcp, path, sizeof path);
    else
        line = pty_open(path, sizeof path);
    if (line < 0 && listener < 0) {
        fprintf(stderr, "heli3dof-rig: no %s: %s\n", options.tcp >= 0 ? "port" : "PTY",
                strerror(errno));
        exit(3);
    }
    if (options.log)
        log_file = opened("--log", options.log);
    if (options.late)
        late_file = opened("--late", options.late);
    if (options.motion)
        motion_file = opened("--motion", options.motion);
    if (options.link) {
        unlink(options.link);
        if (symlink(path, options.link) < 0) {
            fprintf(stderr, "heli3dof-rig: --link %s: %s\n", options.link, strerror(errno));
            exit(2);
        }
    }
    printf("%s\n", path);
    fflush(stdout);
}

int main(int argc, char **argv)
{
    static const int32_t ZERO[2] = {0, 0};
    bool reset = false;
    const pid_t parent = getppid();
    options = options_read(argc, argv);
    noise = options.seed * 2654435769u | 1u;
    bench_start(&bench, &options, monotonic_s());
    const struct sigaction on_end = {.sa_handler = end};
    sigaction(SIGTERM, &on_end, NULL);
    sigaction(SIGINT, &on_end, NULL);
    signal(SIGPIPE, SIG_IGN);
    real_time();
    open_port_and_logs();
    start();
    while (!ended && !(options.with_parent && getppid() != parent)) {
        wait_for_host_or_time();
        const uint64_t sampled_us = device.sampled_us;
        rig_turn(&device);
        deliver();
        log_late(sampled_us);
        log_motion();
        if (device.state == ARMED && bench.armed_s >= NEVER)
            bench.armed_s = monotonic_s();
        if (!reset && bench_due(&bench, monotonic_s(), options.reset_s)) {
            reset = true;
            bench_reset_counters(&bench);
            start();
        }
    }
    hal_output(false, ZERO);
    if (options.link)
        unlink(options.link);
    return 0;
}
