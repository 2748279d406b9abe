#include "link.h"

bool link_in_byte(struct link_in *in, uint8_t byte, size_t *n)
{
    if (byte != 0) {
        if (in->n < FRAME_LONGEST)
            in->piece[in->n] = byte;
        if (in->n <= FRAME_LONGEST)
            in->n++;
        return false;
    }
    *n = in->n;
    in->n = 0;
    return *n > 0;
}

void link_out_frame(struct link_out *out, const uint8_t *frame, size_t n, size_t spare)
{
    if (n + spare > LINK_OUT - (out->head - out->tail)) {
        out->dropped++;
        return;
    }
    for (size_t i = 0; i < n; i++)
        out->ring[out->head++ % LINK_OUT] = frame[i];
}

size_t link_out_peek(const struct link_out *out, const uint8_t **at)
{
    const uint32_t from = out->tail % LINK_OUT;
    const uint32_t waiting = out->head - out->tail;
    *at = out->ring + from;
    return waiting < LINK_OUT - from ? waiting : LINK_OUT - from;
}

void link_out_sent(struct link_out *out, size_t n)
{
    out->tail += (uint32_t)n;
}
