/* The EK-LM3S6965 evaluation board as a rig's amplifier controller.
 *
 *     UART 0 (USB)   the link, 921600 baud        PB0, PB1   PWM to the front and back amplifier:
 *     PE2, PE3       roll encoder A, B                       20 kHz, half = 0 V, full = 24 V
 *     PD4, PD5       pitch encoder A, B           PF0        the amplifiers' enable; the LED
 *     PD6, PD7       yaw encoder A, B             PF1        stop button (Select), pressed = 0
 *     PE0, PE1       fault, stall (Up, Down on the kit's keys), active = 0
 *
 * The clock, the UART, the lines and the interrupts are tested under qemu-system-arm, which does not
 * model the PWM. */
#include "encoder.h"
#include "hal.h"
#include "registers.h"
#include "rig.h"

#define CLOCK_MHZ 50u
#define TICKS_PER_MS (1000u * CLOCK_MHZ)
#define PWM_TICKS 2500u
#define V_MAX_UV 24000000
#define RX_ROOM 256u /* a power of two */

int main(void);
void systick(void);
void port_edges(void);
void uart0(void);

static struct device device;
static struct encoder encoders[3];
static volatile uint64_t ms;
static volatile uint8_t rx[RX_ROOM];
static volatile uint32_t rx_head;
static uint32_t rx_tail;

static void interrupts_off(void)
{
    __asm volatile("cpsid i" ::: "memory");
}

static void interrupts_on(void)
{
    __asm volatile("cpsie i" ::: "memory");
}

/* ---- interrupts ------------------------------------------------------------------------ */

void systick(void)
{
    ms++;
}

static uint8_t lines(uint32_t port, unsigned a)
{
    const uint32_t both = GPIO_DATA(port, 3u << a) >> a; /* bit 0 is A */
    return (uint8_t)((both & 1u) << 1 | both >> 1);
}

void port_edges(void)
{
    GPIO_CLEAR(PORT_D) = 0xF0;
    GPIO_CLEAR(PORT_E) = 0x0C;
    encoder_step(&encoders[0], lines(PORT_E, 2));
    encoder_step(&encoders[1], lines(PORT_D, 4));
    encoder_step(&encoders[2], lines(PORT_D, 6));
}

void uart0(void)
{
    UART_CLEAR = UART_INT_RX | UART_INT_TIMEOUT;
    while (!(UART_FLAGS & UART_RX_EMPTY)) {
        const uint8_t byte = (uint8_t)UART_DATA;
        if (rx_head - rx_tail < RX_ROOM)
            rx[rx_head++ % RX_ROOM] = byte;
    }
}

/* ---- HAL ------------------------------------------------------------------------------- */

uint64_t hal_now_us(void)
{
    interrupts_off();
    uint32_t left = SYSTICK_VAL;
    uint64_t now_ms = ms;
    if (ICSR & ICSR_PENDSTSET) { /* it has wrapped; the interrupt has not counted it yet */
        left = SYSTICK_VAL;
        now_ms++;
    }
    interrupts_on();
    return now_ms * 1000u + (TICKS_PER_MS - 1u - left) / CLOCK_MHZ;
}

size_t hal_read(uint8_t *bytes, size_t room)
{
    size_t n = 0;
    while (n < room && rx_tail != rx_head)
        bytes[n++] = rx[rx_tail++ % RX_ROOM];
    return n;
}

size_t hal_write(const uint8_t *bytes, size_t n)
{
    size_t sent = 0;
    while (sent < n && !(UART_FLAGS & UART_TX_FULL))
        UART_DATA = bytes[sent++];
    return sent;
}

void hal_inputs(struct device_inputs *inputs)
{
    *inputs = (struct device_inputs){
        .mA = {NOT_MEASURED, NOT_MEASURED},
        .fault = GPIO_DATA(PORT_E, 1) ? 0 : CAUSE_OVERCURRENT,
        .stall = !GPIO_DATA(PORT_E, 2),
        .button = !GPIO_DATA(PORT_F, 2),
    };
    interrupts_off();
    for (int i = 0; i < 3; i++) {
        inputs->counts[i] = encoder_count(&encoders[i]);
        inputs->encoder_errors += encoders[i].errors;
    }
    interrupts_on();
}

static uint32_t compare(int32_t uV)
{
    const int32_t half = (int32_t)PWM_TICKS / 2;
    return (uint32_t)(half - (int32_t)((int64_t)uV * (half - 1) / V_MAX_UV));
}

void hal_output(bool enabled, const int32_t uV[2])
{
    PWM1_CMPA = compare(uV[0]);
    PWM1_CMPB = compare(uV[1]);
    GPIO_DATA(PORT_F, 1) = enabled;
}

/* ---- start ----------------------------------------------------------------------------- */

/* PLL from the 8 MHz crystal, 200 MHz / 4. */
static void start_clock(void)
{
    RCC = (RCC | RCC_BYPASS) & ~RCC_USESYSDIV;
    RCC = RCC_BYPASS | 3u << 23 | RCC_USESYSDIV | 0xEu << 6;
    while (!(RIS & 1u << 6)) {
    }
    RCC &= ~RCC_BYPASS;
    SYSTICK_LOAD = TICKS_PER_MS - 1u;
    SYSTICK_VAL = 0;
    SYSTICK_CTRL = 7; /* the processor's clock, interrupt, on */
}

static void start_pins(void)
{
    RCGC0 |= 1u << 20; /* PWM */
    RCGC1 |= 1u;       /* UART 0 */
    RCGC2 |= 0x3Bu;    /* ports A, B, D, E, F */
    (void)RCGC2;       /* the clocks need some cycles */
    (void)RCGC2;
    GPIO_DIR(PORT_F) = 1;
    GPIO_DATA(PORT_F, 1) = 0;
    GPIO_PULL_UP(PORT_F) = 2;
    GPIO_DIGITAL(PORT_F) = 3;
    GPIO_PULL_UP(PORT_E) = 0x0F;
    GPIO_DIGITAL(PORT_E) = 0x0F;
    GPIO_PULL_UP(PORT_D) = 0xF0;
    GPIO_DIGITAL(PORT_D) = 0xF0;
    GPIO_BOTH_EDGES(PORT_E) = 0x0C;
    GPIO_BOTH_EDGES(PORT_D) = 0xF0;
    encoder_start(&encoders[0], lines(PORT_E, 2));
    encoder_start(&encoders[1], lines(PORT_D, 4));
    encoder_start(&encoders[2], lines(PORT_D, 6));
    GPIO_MASK(PORT_E) = 0x0C;
    GPIO_MASK(PORT_D) = 0xF0;

    GPIO_ALTERNATE(PORT_B) = 3;
    GPIO_DIGITAL(PORT_B) = 3;
    PWM1_LOAD = PWM_TICKS - 1u;
    PWM1_CMPA = PWM1_CMPB = compare(0);
    PWM1_GENA = 0x8C;  /* high at the load, low at compare A on the way down */
    PWM1_GENB = 0x80C; /* the same with compare B */
    PWM1_CTL = 1;
    PWM_ENABLE = 0x0C;
}

static void start_uart(void)
{
    GPIO_ALTERNATE(PORT_A) = 3;
    GPIO_DIGITAL(PORT_A) = 3;
    UART_CONTROL = 0;
    UART_IBRD = 3; /* 50 MHz / (16 (3 + 25/64)) = 921 659 baud */
    UART_FBRD = 25;
    UART_LINE = 3u << 5 | 1u << 4; /* 8 bits, FIFOs */
    UART_LEVELS = 0;
    UART_MASK = UART_INT_RX | UART_INT_TIMEOUT;
    UART_CONTROL = 0x301;
    NVIC_ENABLE0 = 1u << IRQ_UART0 | 1u << IRQ_PORT_D | 1u << IRQ_PORT_E;
}

/* Starts the chip's watchdog: after 2 x 25 ms without a turn of the main loop the chip restarts, at
 * zero volts and IDLE. The protocol's watchdog is another: it expires without a host's command. */
static void start_dog(void)
{
    RCGC0 |= 1u << 3;
    (void)RCGC0;
    DOG_LOAD = 25u * TICKS_PER_MS;
    DOG_CONTROL = 3; /* count, reset */
    DOG_LOCK = 1;
}

static void feed_dog(void)
{
    DOG_LOCK = DOG_UNLOCK;
    DOG_CLEAR = 1;
    DOG_LOAD = 25u * TICKS_PER_MS;
    DOG_LOCK = 1;
}

/* Returns the kit's Ethernet address as text. */
static const char *serial_number(void)
{
    static char text[FRAME_TEXT + 1];
    const uint32_t halves[2] = {USER_REG0, USER_REG1};
    for (unsigned i = 0; i < 12; i++) {
        const uint32_t byte = halves[i / 6] >> 8 * (i % 6 / 2) & 0xFFu;
        const uint32_t digit = i % 2 ? byte & 15u : byte >> 4;
        text[i] = (char)(digit < 10 ? '0' + digit : 'a' + digit - 10);
    }
    return text;
}

/* Sets boot number and first ticket. As the chip has no source of entropy, they come from a count
 * of starts in SRAM and the time (to 20 ns) of the host's first byte. They are set at that time. */
static void name_this_start(void)
{
    static uint32_t starts __attribute__((section(".kept")));
    uint32_t mixed = ++starts * 2654435769u ^ (uint32_t)ms * TICKS_PER_MS ^ SYSTICK_VAL;
    mixed = (mixed ^ mixed >> 16) * 0x7FEB352Du;
    mixed = (mixed ^ mixed >> 15) * 0x846CA68Bu;
    device.config.boot = mixed ^ mixed >> 16;
    device.ticket = ~mixed;
}

int main(void)
{
    static const struct device_config CONFIG = {
        .counts = {4096, 4096, 8192},
        .v_max_uV = V_MAX_UV,
        .watchdog_us = 100000,
        .ramp_us = 200000,
        .shortest_us = 1000,
        .model = "EK-LM3S6965",
        .firmware = "c 1.0",
    };
    struct device_config config = CONFIG;
    bool named = false;
    start_clock();
    start_pins();
    start_uart();
    config.serial = serial_number();
    rig_start(&device, &config);
    start_dog();
    for (;;) {
        feed_dog();
        if (!named && rx_head != rx_tail) {
            name_this_start();
            named = true;
        }
        rig_turn(&device);
        /* Sleep until the next interrupt, a millisecond at most. Interrupts are off, so that a byte
         * that arrives before the sleep leaves one pending, which ends the sleep. */
        const bool soon = device_next_us(&device) < hal_now_us() + 1000u;
        interrupts_off();
        if (!soon && rx_head == rx_tail)
            __asm volatile("wfi");
        interrupts_on();
    }
}
