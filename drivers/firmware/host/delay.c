#include "delay.h"

void delay_put(struct delay *delay, uint64_t arrives_us, uint8_t byte)
{
    if (delay->head - delay->tail == DELAY_ROOM)
        return;
    delay->arrives_us[delay->head % DELAY_ROOM] = arrives_us;
    delay->bytes[delay->head++ % DELAY_ROOM] = byte;
}

size_t delay_get(struct delay *delay, uint64_t now_us, uint8_t *bytes, size_t room)
{
    size_t n = 0;
    while (n < room && delay_next_us(delay) <= now_us)
        bytes[n++] = delay->bytes[delay->tail++ % DELAY_ROOM];
    return n;
}

uint64_t delay_next_us(const struct delay *delay)
{
    return delay->head == delay->tail ? UINT64_MAX : delay->arrives_us[delay->tail % DELAY_ROOM];
}
