#include "device.h"

void device_start(struct device *device, const struct device_config *config, uint64_t now_us)
{
    *device = (struct device){
        .config = *config,
        .ticket = config->ticket,
        .start_us = now_us,
        .heard_us = now_us,
        .inputs.mA = {NOT_MEASURED, NOT_MEASURED},
    };
}

uint8_t device_flags(const struct device *device)
{
    unsigned flags = 0;
    switch (device->state) {
    case IDLE: break;
    case ARMED: flags = FLAG_ENABLED | (device->saturated ? FLAG_SATURATED : 0u); break;
    case LATCHED: flags = FLAG_LATCHED; break;
    case STOPPED: flags = device->stop_flag; break;
    }
    if (device->inputs.fault)
        flags |= FLAG_FAULT;
    if (device->inputs.stall)
        flags |= FLAG_STALL;
    return (uint8_t)flags;
}

/* ---- output ---------------------------------------------------------------------------- */

static uint64_t expiry_us(const struct device *device)
{
    return device->command_us + device->watchdog_us;
}

/* When LATCHED, the output is v (1 - (t - t_expired) / ramp), rounded towards zero. */
bool device_output(const struct device *device, uint64_t now_us, int32_t uV[2])
{
    const uint64_t ramp_us = device->config.ramp_us;
    uint64_t left_us = 0;
    uV[0] = uV[1] = 0;
    if (device->state == ARMED) {
        uV[0] = device->set_uV[0];
        uV[1] = device->set_uV[1];
        return true;
    }
    if (device->state == LATCHED && now_us - expiry_us(device) < ramp_us)
        left_us = ramp_us - (now_us - expiry_us(device));
    if (left_us == 0 || (device->set_uV[0] == 0 && device->set_uV[1] == 0))
        return false; /* the ramp is over, or DISARM ended it */
    for (int i = 0; i < 2; i++)
        uV[i] = (int32_t)((int64_t)device->set_uV[i] * (int64_t)left_us / (int64_t)ramp_us);
    return true;
}

static void zero(struct device *device)
{
    device->set_uV[0] = device->set_uV[1] = 0;
    device->saturated = false;
}

static int32_t clip(struct device *device, int32_t uV)
{
    const int32_t most = (int32_t)device->config.v_max_uV;
    if (uV >= -most && uV <= most)
        return uV;
    device->saturated = true;
    return uV > 0 ? most : -most;
}

/* ---- state ----------------------------------------------------------------------------- */

static void stop(struct device *device, uint8_t cause, uint8_t flag)
{
    zero(device);
    device->state = STOPPED;
    device->stop_flag = flag;
    device->cause = cause;
    device->ticket++;
}

void device_stop(struct device *device, uint8_t cause)
{
    stop(device, cause, FLAG_STOPPED);
}

/* ---- answers --------------------------------------------------------------------------- */

static void send_ack(struct device *device, const struct request *request, enum code code)
{
    uint8_t frame[FRAME_LONGEST_OUT];
    const struct ack ack = {
        .request = request->type,
        .code = (uint8_t)code,
        .flags = device_flags(device),
        .cause = device->cause,
        .ticket = device->ticket,
    };
    link_out_frame(&device->out, frame, frame_ack(frame, request->number, &ack), 0);
}

static void send_identity(struct device *device, uint32_t number)
{
    uint8_t frame[FRAME_LONGEST_OUT];
    const struct device_config *config = &device->config;
    const struct identity identity = {
        .version = FRAME_VERSION,
        .flags = device_flags(device),
        .boot = config->boot,
        .ticket = device->ticket,
        .counts = {config->counts[0], config->counts[1], config->counts[2]},
        .v_max_uV = config->v_max_uV,
        .watchdog_us = config->watchdog_us,
        .ramp_us = config->ramp_us,
        .shortest_us = config->shortest_us,
        .model = config->model,
        .serial = config->serial,
        .firmware = config->firmware,
    };
    link_out_frame(&device->out, frame, frame_identity(frame, number, &identity), 0);
}

static void send_sample(struct device *device, uint64_t now_us)
{
    uint8_t frame[FRAME_LONGEST_OUT];
    const struct device_inputs *inputs = &device->inputs;
    struct sample sample = {
        .echo = device->echo,
        .time_us = (uint32_t)now_us,
        .counts = {inputs->counts[0], inputs->counts[1], inputs->counts[2]},
        .mA = {inputs->mA[0], inputs->mA[1]},
        .delay_us = UINT16_MAX,
        .flags = device_flags(device),
        .cause = device->cause,
    };
    if (device->fresh && device->command_us - device->sampled_us < UINT16_MAX)
        sample.delay_us = (uint16_t)(device->command_us - device->sampled_us);
    device_output(device, now_us, sample.uV);
    const size_t n = frame_sample(frame, device->samples++, &sample);
    link_out_frame(&device->out, frame, n, LINK_SPARE);
    device->sampled_us = now_us;
    device->fresh = false;
}

static void send_report(struct device *device, uint32_t number, uint64_t now_us)
{
    uint8_t frame[FRAME_LONGEST_OUT];
    const struct report report = {
        .frames = device->frames,
        .malformed = device->malformed,
        .refused = device->refused,
        .expiries = device->expiries,
        .late_us = device->late_us,
        .encoder_errors = device->inputs.encoder_errors,
        .uptime_ms = (uint32_t)((now_us - device->start_us) / 1000),
        .flags = device_flags(device),
        .cause = device->cause,
        .ticket = device->ticket,
    };
    link_out_frame(&device->out, frame, frame_report(frame, number, &report), 0);
}

/* ---- time ------------------------------------------------------------------------------ */

static void stream(struct device *device, uint64_t now_us)
{
    if (now_us > device->heard_us + STREAM_SILENCE_US) {
        device->period_us = 0;
    } else if (now_us >= device->next_us) {
        /* Late by a period or more: skip the samples in between instead of sending a burst. Only
         * the time shows it; a gap in the numbers would mean that the line lost samples. */
        const uint64_t late_us = now_us - device->next_us;
        const uint64_t skipped = late_us / device->period_us;
        if (late_us > device->late_us)
            device->late_us = late_us < UINT32_MAX ? (uint32_t)late_us : UINT32_MAX;
        device->next_us += (skipped + 1) * device->period_us;
        send_sample(device, now_us);
    }
}

static void expire(struct device *device, uint64_t now_us)
{
    if (device->state == ARMED && now_us > expiry_us(device)) {
        device->state = LATCHED;
        device->cause = CAUSE_WATCHDOG;
        device->ticket++;
        device->expiries++;
    }
}

void device_tick(struct device *device, uint64_t now_us)
{
    expire(device, now_us);
    if (device->period_us)
        stream(device, now_us);
}

void device_sense(struct device *device, uint64_t now_us, const struct device_inputs *inputs)
{
    const struct device_inputs before = device->inputs;
    expire(device, now_us);
    device->inputs = *inputs; /* before the tick: a sample carries the counts of its own time */
    if (inputs->button && !before.button)
        stop(device, CAUSE_BUTTON, FLAG_STOPPED);
    if (inputs->stall && !before.stall)
        stop(device, CAUSE_STALL, FLAG_STALL);
    if (inputs->fault && !before.fault)
        stop(device, inputs->fault, FLAG_FAULT);
    device_tick(device, now_us);
}

uint64_t device_next_us(const struct device *device)
{
    uint64_t next_us = UINT64_MAX;
    if (device->state == ARMED)
        next_us = expiry_us(device) + 1;
    if (device->period_us && device->next_us < next_us)
        next_us = device->next_us;
    return next_us;
}

/* ---- requests -------------------------------------------------------------------------- */

static uint32_t watchdog_asked(const struct device *device, const struct request *arm)
{
    return arm->watchdog_us ? arm->watchdog_us : device->config.watchdog_us;
}

static enum code may_arm(const struct device *device, const struct request *arm)
{
    const uint32_t watchdog_us = watchdog_asked(device, arm);
    const bool faulty = device->inputs.fault || device->inputs.stall || device->inputs.button;
    if (device->state == ARMED)
        return ALREADY_ARMED;
    if (arm->ticket != device->ticket)
        return STALE_TICKET;
    if (faulty)
        return FAULT;
    if (arm->period_us && arm->period_us < device->config.shortest_us)
        return BAD_PARAMETER;
    if (watchdog_us > WATCHDOG_LONGEST_US || watchdog_us / 2 < arm->period_us)
        return BAD_PARAMETER;
    return OK;
}

static void arm(struct device *device, uint64_t now_us, const struct request *request)
{
    const enum code code = may_arm(device, request);
    if (code == OK) {
        zero(device);
        device->state = ARMED;
        device->cause = CAUSE_NONE;
        device->ticket++;
        device->echo = request->number;
        device->command_us = now_us;
        device->watchdog_us = watchdog_asked(device, request);
        device->period_us = request->period_us;
        device->next_us = now_us + request->period_us;
        device->samples = 0;
        device->fresh = false;
    }
    send_ack(device, request, code);
    if (code == OK)
        send_sample(device, now_us);
}

static void command(struct device *device, uint64_t now_us, const struct request *request)
{
    const uint32_t ahead = request->number - device->echo;
    if (device->state != ARMED || ahead == 0 || ahead >= 0x80000000u) {
        device->refused++;
        return;
    }
    device->echo = request->number;
    device->command_us = now_us;
    device->fresh = true;
    device->saturated = false;
    for (int i = 0; i < 2; i++)
        device->set_uV[i] = clip(device, request->uV[i]);
}

static void disarm(struct device *device, const struct request *request)
{
    zero(device);
    if (device->state == ARMED)
        device->state = IDLE;
    device->period_us = 0;
    device->ticket++;
    send_ack(device, request, OK);
}

static void answer(struct device *device, uint64_t now_us, const struct request *request)
{
    switch (request->type) {
    case HELLO:
        if (request->oldest <= FRAME_VERSION && FRAME_VERSION <= request->newest)
            send_identity(device, request->number);
        else
            send_ack(device, request, VERSION);
        break;
    case ARM: arm(device, now_us, request); break;
    case COMMAND: command(device, now_us, request); break;
    case POLL:
        if (device->period_us)
            device->refused++;
        else
            send_sample(device, now_us);
        break;
    case DISARM: disarm(device, request); break;
    case ESTOP:
        stop(device, request->reason, FLAG_STOPPED);
        send_ack(device, request, OK);
        break;
    case STATUS: send_report(device, request->number, now_us); break;
    default:
        device->refused++;
        /* Bit 7 marks a device's frame: on a line with echo it may be this device's own. */
        if (!(request->type & 0x80u))
            send_ack(device, request, UNKNOWN_TYPE);
        break;
    }
}

void device_receive(struct device *device, uint64_t now_us, const uint8_t *bytes, size_t n)
{
    struct request request;
    size_t length;
    device_tick(device, now_us);
    for (size_t i = 0; i < n; i++) {
        if (!link_in_byte(&device->in, bytes[i], &length))
            continue;
        if (frame_read(device->in.piece, length, &request) == FRAME_MALFORMED) {
            device->malformed++;
            continue;
        }
        device->frames++;
        device->heard_us = now_us;
        answer(device, now_us, &request);
    }
}
