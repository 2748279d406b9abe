#include "encoder.h"

/* Counts of a step, at index before << 2 | now of the lines A << 1 | B; 2 marks an invalid step. */
static const int8_t STEP[16] = {
    0,  -1, +1, 2,  /* from 00 to 00, 01, 10, 11 */
    +1, 0,  2,  -1, /* from 01 */
    -1, 2,  0,  +1, /* from 10 */
    2,  +1, -1, 0,  /* from 11 */
};

void encoder_start(struct encoder *encoder, uint8_t lines)
{
    *encoder = (struct encoder){.lines = lines & 3u};
}

void encoder_step(struct encoder *encoder, uint8_t lines)
{
    const uint8_t now = lines & 3u;
    const int32_t step = STEP[encoder->lines << 2 | now];
    encoder->lines = now;
    if (step == 2)
        encoder->errors++;
    else
        encoder->count += (uint32_t)step;
}

int32_t encoder_count(const struct encoder *encoder)
{
    const uint32_t u = encoder->count;
    return u < 0x80000000u ? (int32_t)u : (int32_t)(u - 0x80000000u) + INT32_MIN;
}
