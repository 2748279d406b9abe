/* Start-up code: vectors, memory, and the two functions that the compiler requires. A fault of the
 * processor ends in `fault`, which clears the motors' enable line. */
#include <stddef.h>
#include <stdint.h>

#include "registers.h"

extern uint32_t data_begin[], data_end[], data_stored[], bss_begin[], bss_end[], stack_top[];

int main(void);
void reset(void);
void systick(void);
void port_edges(void);
void uart0(void);
void *memcpy(void *to, const void *from, size_t n);
void *memset(void *at, int value, size_t n);

void *memcpy(void *to, const void *from, size_t n)
{
    uint8_t *a = to;
    const uint8_t *b = from;
    while (n--)
        *a++ = *b++;
    return to;
}

void *memset(void *at, int value, size_t n)
{
    uint8_t *a = at;
    while (n--)
        *a++ = (uint8_t)value;
    return at;
}

static void fault(void)
{
    GPIO_DATA(PORT_F, 1) = 0;
    for (;;) {
    }
}

void reset(void)
{
    const uint32_t *from = data_stored;
    for (uint32_t *to = data_begin; to < data_end;)
        *to++ = *from++;
    for (uint32_t *to = bss_begin; to < bss_end;)
        *to++ = 0;
    main();
    fault();
}

typedef void (*vector)(void);

__attribute__((section(".vectors"), used)) static const vector VECTORS[16 + 8] = {
    (vector)(uintptr_t)stack_top,
    reset,
    fault, /* NMI */
    fault, /* hard fault */
    fault, /* memory management */
    fault, /* bus */
    fault, /* usage */
    0,
    0,
    0,
    0,
    fault, /* SVC */
    fault, /* debug */
    0,
    fault, /* PendSV */
    systick,
    fault, /* port A */
    fault,
    fault,
    port_edges, /* port D */
    port_edges, /* port E */
    uart0,
    fault,
    fault,
};
