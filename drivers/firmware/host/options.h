/* The command line of heli3dof-rig. */
#ifndef HELI3DOF_OPTIONS_H
#define HELI3DOF_OPTIONS_H

#include <stdint.h>

#include "plant.h"

/* Times count in seconds from the first arming; NEVER for a drill that is off. */
#define NEVER 1e300

struct options {
    const char *serial;
    const char *link; /* a symbolic link to the PTY, or NULL */
    const char *log;  /* file for motor voltages with times, or NULL */
    const char *late; /* file for the samples that this program wrote late, or NULL */
    const char *motion; /* file for the plant's roll angle and rate, or NULL */
    int tcp;          /* a port of this computer instead of a PTY, 0 any; -1: a PTY */
    int with_parent;  /* ends with the parent process */
    uint32_t watchdog_us, ramp_us, shortest_us;
    int32_t counts[3];
    int boot_given; /* the same boot number at every start, as on boards without a random source */
    uint32_t boot;

    double fault_s, fault_for_s;
    double stall_s, stall_for_s;
    double button_s;
    double reset_s;
    enum axis freeze_axis;
    double freeze_s;
    enum axis jump_axis;
    double jump_s;
    long jump_counts;

    double delay_s; /* of every byte, each way */
    double drop, corrupt; /* probability for each byte, both directions */
    uint32_t seed;
};

/* Reads the command line. Ends the program if it is wrong (exit code 2), and for --help (0). */
struct options options_read(int argc, char **argv);

#endif
