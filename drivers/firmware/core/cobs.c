#include "cobs.h"

size_t cobs_encode(const uint8_t *in, size_t n, uint8_t *out)
{
    size_t code = 0; /* index of the current piece's length */
    size_t end = 1;
    for (size_t i = 0; i < n; i++) {
        if (in[i] == 0) {
            out[code] = (uint8_t)(end - code);
            code = end++;
        } else {
            out[end++] = in[i];
        }
    }
    out[code] = (uint8_t)(end - code);
    return end;
}

size_t cobs_decode(const uint8_t *in, size_t n, uint8_t *out)
{
    size_t length = 0;
    size_t i = 0;
    if (n == 0)
        return COBS_BAD;
    while (i < n) {
        const size_t code = in[i++];
        if (code == 0 || code - 1 > n - i)
            return COBS_BAD;
        for (size_t k = 1; k < code; k++) {
            if (in[i] == 0)
                return COBS_BAD;
            out[length++] = in[i++];
        }
        if (code < 0xFF && i < n)
            out[length++] = 0;
    }
    return length;
}
