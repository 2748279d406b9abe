/* Drives the harness without libFuzzer: random programs, and mutations of earlier ones.
 * `heli3dof-fuzz SECONDS [SEED]`. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static uint64_t state;

static uint32_t any(void) /* splitmix64 */
{
    uint64_t z = state += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return (uint32_t)(z >> 32);
}

int main(int argc, char **argv)
{
    static uint8_t program[512];
    const double seconds = argc > 1 ? atof(argv[1]) : 60;
    const time_t end = time(NULL) + (time_t)seconds;
    unsigned long runs = 0;
    state = argc > 2 ? strtoul(argv[2], NULL, 10) : 1;
    do {
        const uint32_t changes = runs % 8 ? 1 + any() % 16 : sizeof program;
        for (uint32_t i = 0; i < changes; i++)
            program[any() % sizeof program] = (uint8_t)any();
        /* On the heap, so that a sanitizer detects the first byte beyond the end. */
        const size_t n = 1 + any() % sizeof program;
        uint8_t *copy = malloc(n);
        if (!copy)
            return 1;
        for (size_t i = 0; i < n; i++)
            copy[i] = program[i];
        LLVMFuzzerTestOneInput(copy, n);
        free(copy);
        runs++;
    } while (runs % 1024 || time(NULL) < end);
    printf("%lu programs, every statement held\n", runs);
    return 0;
}
