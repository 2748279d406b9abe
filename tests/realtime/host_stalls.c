/* host_stalls CPU: sleeps for EVERY again and again on one processor, with the highest priority if
 * permitted. If it wakes more than STILL late, it prints when it fell asleep and when it woke, in s
 * of CLOCK_MONOTONIC. In C, since an interpreter would cause delays itself. */
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

#define EVERY_NS 250000L
#define STILL_NS 400000L

static double seconds(const struct timespec *t)
{
    return (double)t->tv_sec + 1e-9 * (double)t->tv_nsec;
}

int main(int argc, char **argv)
{
    const struct timespec every = {0, EVERY_NS};
    const struct sched_param above_all = {.sched_priority = 95};
    struct timespec before, after;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET((size_t)(argc > 1 ? atoi(argv[1]) : 0), &one);
    if (sched_setaffinity(0, sizeof one, &one))
        return 1;
    prctl(PR_SET_TIMERSLACK, 1ul);
    if (sched_setscheduler(0, SCHED_FIFO, &above_all) == 0)
        mlockall(MCL_CURRENT | MCL_FUTURE);
    setvbuf(stdout, NULL, _IOLBF, 0);
    puts("watching");
    clock_gettime(CLOCK_MONOTONIC, &before);
    for (;;) {
        clock_nanosleep(CLOCK_MONOTONIC, 0, &every, NULL);
        clock_gettime(CLOCK_MONOTONIC, &after);
        if (seconds(&after) - seconds(&before) > 1e-9 * (EVERY_NS + STILL_NS))
            printf("%.6f %.6f\n", seconds(&before), seconds(&after));
        before = after;
    }
}
