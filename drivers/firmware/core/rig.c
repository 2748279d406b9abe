#include "rig.h"

#include "hal.h"

static void put_out(const struct device *device, uint64_t now_us)
{
    int32_t uV[2];
    const bool enabled = device_output(device, now_us, uV);
    hal_output(enabled, uV);
}

static void send(struct device *device)
{
    const uint8_t *at;
    size_t n;
    while ((n = link_out_peek(&device->out, &at)) > 0) {
        const size_t sent = hal_write(at, n);
        link_out_sent(&device->out, sent);
        if (sent < n)
            return;
    }
}

void rig_start(struct device *device, const struct device_config *config)
{
    device_start(device, config, hal_now_us());
    put_out(device, hal_now_us());
}

void rig_turn(struct device *device)
{
    uint8_t bytes[FRAME_LONGEST];
    struct device_inputs inputs;
    const uint64_t now_us = hal_now_us();
    hal_inputs(&inputs);
    device_sense(device, now_us, &inputs);
    /* A bounded number of bytes, so that a flood of bytes cannot delay the output. */
    const size_t n = hal_read(bytes, sizeof bytes);
    device_receive(device, now_us, bytes, n);
    put_out(device, now_us);
    send(device);
}
