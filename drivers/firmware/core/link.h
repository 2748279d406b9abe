/* Splits received bytes into pieces, and buffers frames to be sent. Never waits.
 *
 * In: the bytes between two delimiters, at most FRAME_LONGEST. Out: a ring; a frame that does not fit
 * is dropped whole, so that a host that does not read causes no delay and gets valid frames later.
 * Samples leave LINK_SPARE bytes free for replies: an unread stream must not block an ESTOP's ACK. */
#ifndef HELI3DOF_LINK_H
#define HELI3DOF_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frames.h"

#define LINK_OUT 1024u /* a power of two */
#define LINK_SPARE 256u

struct link_in {
    uint8_t piece[FRAME_LONGEST];
    size_t n; /* FRAME_LONGEST + 1: too long, the rest is not kept */
};

struct link_out {
    uint8_t ring[LINK_OUT];
    uint32_t head, tail; /* bytes written and read, modulo 2^32 */
    uint32_t dropped;    /* frames */
};

/* Takes a byte. Returns true when it ends a piece that is not empty: `n` bytes in `in->piece`. The
 * next byte overwrites it. */
bool link_in_byte(struct link_in *in, uint8_t byte, size_t *n);

/* Queues a frame, or drops it if fewer than `spare` bytes would stay free. */
void link_out_frame(struct link_out *out, const uint8_t *frame, size_t n, size_t spare);

/* Returns the number of bytes to send next, contiguous from `*at`. Call link_out_sent with the
 * number that was sent. */
size_t link_out_peek(const struct link_out *out, const uint8_t **at);
void link_out_sent(struct link_out *out, size_t n);

#endif
