#include "options.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HELP[] =
    "heli3dof-rig: the firmware on a PTY, with a bench plant behind it. The first line it prints\n"
    "is the PTY's path; it serves until it is ended.\n"
    "\n"
    "  --serial S                 serial number (FW-0001)\n"
    "  --tcp PORT                 no PTY: 127.0.0.1, port PORT (0: any); socket://… is printed\n"
    "  --link PATH                a symbolic link to the PTY, removed at the end\n"
    "  --log FILE                 appends 'CLOCK_MONOTONIC_s enabled front_V back_V' at each change\n"
    "  --late FILE                appends 'time_us late_us' of each sample that was written more\n"
    "                             than 0.2 ms after its time: the program itself was held up\n"
    "  --motion FILE              appends 'CLOCK_MONOTONIC_s roll_rad roll_rad_per_s' every 5 ms: the\n"
    "                             plant's own, whatever an encoder shows\n"
    "  --counts ROLL,PITCH,YAW    per revolution, negative: falls as the angle rises\n"
    "  --boot N                   the boot number of every start (drawn at random each time)\n"
    "  --with-parent              end when the process that started it ends\n"
    "  --watchdog MS  --ramp MS   the device's own (100, 200)\n"
    "  --shortest US              shortest period of the stream (500)\n"
    "\n"
    "Drills; S counts from the first arming:\n"
    "  --fault-after S[:FOR]      the amplifier reports an overcurrent (for FOR seconds)\n"
    "  --stall-after S[:FOR]      a motor does not turn\n"
    "  --button-after S           somebody presses the button, for 0.1 s\n"
    "  --reset-after S            the device starts again, as after a brown-out\n"
    "  --freeze-encoder AXIS@S    its lines stand still from then on\n"
    "  --jump-encoder AXIS@S:N    N counts that no motion made\n"
    "  --delay MS                 every byte takes so long on the line, each way\n"
    "  --drop P  --corrupt P      each byte is lost, or has a wrong bit, in both directions\n"
    "  --seed N                   of the two above\n";

__attribute__((noreturn)) static void refuse(const char *option, const char *value,
                                             const char *wanted)
{
    fprintf(stderr, "heli3dof-rig: --%s %s: expected %s. heli3dof-rig --help lists the options.\n",
            option, value, wanted);
    exit(2);
}

static double number(const char *option, const char *text, char **end)
{
    errno = 0;
    const double value = strtod(text, end);
    if (*end == text || errno || value < 0 || !(value < 1e9))
        refuse(option, text, "a number that is not negative");
    return value;
}

static double only_number(const char *option, const char *text)
{
    char *end;
    const double value = number(option, text, &end);
    if (*end)
        refuse(option, text, "a number and nothing behind it");
    return value;
}

static uint32_t whole(const char *option, const char *text, uint32_t most)
{
    const double value = only_number(option, text);
    if (value > most)
        refuse(option, text, "less: see docs/reference/protocol.md");
    return (uint32_t)value;
}

static double share(const char *option, const char *text)
{
    const double value = only_number(option, text);
    if (value > 1)
        refuse(option, text, "a probability, 0 to 1");
    return value;
}

/* S[:FOR] */
static void span(const char *option, const char *text, double *from_s, double *for_s)
{
    char *end;
    *from_s = number(option, text, &end);
    *for_s = NEVER;
    if (*end == ':')
        *for_s = only_number(option, end + 1);
    else if (*end)
        refuse(option, text, "SECONDS or SECONDS:FOR");
}

/* AXIS@S and the rest */
static const char *axis_at(const char *option, const char *text, enum axis *axis, double *at_s)
{
    static const char *const NAMES[3] = {"roll@", "pitch@", "yaw@"};
    char *end;
    for (int i = 0; i < 3; i++) {
        if (strncmp(text, NAMES[i], strlen(NAMES[i])) == 0) {
            *axis = (enum axis)i;
            *at_s = number(option, text + strlen(NAMES[i]), &end);
            return end;
        }
    }
    refuse(option, text, "roll@SECONDS, pitch@SECONDS or yaw@SECONDS");
}

enum name {
    HELP_WANTED = 1, WITH_PARENT, SERIAL, LINK, LOG, LATE, MOTION, TCP, COUNTS, BOOT, WATCHDOG, RAMP,
    SHORTEST, FAULT, STALL, BUTTON, RESET, FREEZE, JUMP, DELAY, DROP, CORRUPT, SEED,
};

static const struct option KNOWN[] = {
    {"help", no_argument, NULL, HELP_WANTED},
    {"with-parent", no_argument, NULL, WITH_PARENT},
    {"serial", required_argument, NULL, SERIAL},
    {"link", required_argument, NULL, LINK},
    {"log", required_argument, NULL, LOG},
    {"late", required_argument, NULL, LATE},
    {"motion", required_argument, NULL, MOTION},
    {"tcp", required_argument, NULL, TCP},
    {"counts", required_argument, NULL, COUNTS},
    {"boot", required_argument, NULL, BOOT},
    {"watchdog", required_argument, NULL, WATCHDOG},
    {"ramp", required_argument, NULL, RAMP},
    {"shortest", required_argument, NULL, SHORTEST},
    {"fault-after", required_argument, NULL, FAULT},
    {"stall-after", required_argument, NULL, STALL},
    {"button-after", required_argument, NULL, BUTTON},
    {"reset-after", required_argument, NULL, RESET},
    {"freeze-encoder", required_argument, NULL, FREEZE},
    {"jump-encoder", required_argument, NULL, JUMP},
    {"delay", required_argument, NULL, DELAY},
    {"drop", required_argument, NULL, DROP},
    {"corrupt", required_argument, NULL, CORRUPT},
    {"seed", required_argument, NULL, SEED},
    {NULL, 0, NULL, 0},
};

static const struct options DEFAULTS = {
    .serial = "FW-0001",
    .watchdog_us = 100000,
    .ramp_us = 200000,
    .shortest_us = 500,
    .counts = {4096, 4096, 8192},
    .fault_s = NEVER,
    .stall_s = NEVER,
    .button_s = NEVER,
    .reset_s = NEVER,
    .freeze_s = NEVER,
    .jump_s = NEVER,
    .seed = 1,
    .tcp = -1,
};

static void jump(struct options *o, const char *text)
{
    const char *rest = axis_at("jump-encoder", text, &o->jump_axis, &o->jump_s);
    char *end = NULL;
    if (*rest == ':')
        o->jump_counts = strtol(rest + 1, &end, 10);
    if (!end || *end || !o->jump_counts || labs(o->jump_counts) > 1000000)
        refuse("jump-encoder", text, "AXIS@SECONDS:COUNTS");
}

struct options options_read(int argc, char **argv)
{
    struct options o = DEFAULTS;
    int index = 0;
    for (int c; (c = getopt_long(argc, argv, "", KNOWN, &index)) != -1;) {
        const char *name = KNOWN[index].name;
        switch (c) {
        case HELP_WANTED: fputs(HELP, stdout); exit(0);
        case WITH_PARENT: o.with_parent = 1; break;
        case SERIAL: o.serial = optarg; break;
        case LINK: o.link = optarg; break;
        case LOG: o.log = optarg; break;
        case LATE: o.late = optarg; break;
        case MOTION: o.motion = optarg; break;
        case TCP: o.tcp = (int)whole(name, optarg, 65535); break;
        case COUNTS:
            if (sscanf(optarg, "%d,%d,%d", &o.counts[0], &o.counts[1], &o.counts[2]) != 3)
                refuse(name, optarg, "three whole numbers, as 4096,4096,8192");
            break;
        case BOOT:
            o.boot = whole(name, optarg, UINT32_MAX);
            o.boot_given = 1;
            break;
        case WATCHDOG: o.watchdog_us = 1000 * whole(name, optarg, 1000); break;
        case RAMP: o.ramp_us = 1000 * whole(name, optarg, 10000); break;
        case SHORTEST: o.shortest_us = whole(name, optarg, 1000000); break;
        case FAULT: span(name, optarg, &o.fault_s, &o.fault_for_s); break;
        case STALL: span(name, optarg, &o.stall_s, &o.stall_for_s); break;
        case BUTTON: o.button_s = only_number(name, optarg); break;
        case RESET: o.reset_s = only_number(name, optarg); break;
        case FREEZE:
            if (*axis_at(name, optarg, &o.freeze_axis, &o.freeze_s))
                refuse(name, optarg, "AXIS@SECONDS");
            break;
        case JUMP: jump(&o, optarg); break;
        case DELAY: o.delay_s = 1e-3 * only_number(name, optarg); break;
        case DROP: o.drop = share(name, optarg); break;
        case CORRUPT: o.corrupt = share(name, optarg); break;
        case SEED: o.seed = whole(name, optarg, UINT32_MAX); break;
        default: exit(2); /* getopt has printed the reason */
        }
    }
    if (optind < argc)
        refuse("", argv[optind], "options only");
    return o;
}
