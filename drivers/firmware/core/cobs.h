/* Consistent Overhead Byte Stuffing (Cheshire and Baker 1999) without the delimiter:
 * the payload is split at its zeros; each piece is preceded by its length plus one. */
#ifndef HELI3DOF_COBS_H
#define HELI3DOF_COBS_H

#include <stddef.h>
#include <stdint.h>

#define COBS_BAD ((size_t)-1)

/* Stuffs n < 254 bytes into n + 1, none of them zero; returns n + 1. */
size_t cobs_encode(const uint8_t *in, size_t n, uint8_t *out);

/* Decodes the bytes between two delimiters; returns the payload's length, less than n, or
 * COBS_BAD. `out` may be `in`. */
size_t cobs_decode(const uint8_t *in, size_t n, uint8_t *out);

#endif
