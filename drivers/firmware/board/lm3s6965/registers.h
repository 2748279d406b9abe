/* Registers of the Stellaris LM3S6965 that this board's HAL uses (data sheet DS-LM3S6965). */
#ifndef HELI3DOF_LM3S6965_REGISTERS_H
#define HELI3DOF_LM3S6965_REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

/* System control */
#define RIS REGISTER(0x400FE050) /* bit 6: the PLL has locked */
#define RCC REGISTER(0x400FE060)
#define RCGC0 REGISTER(0x400FE100)
#define RCGC1 REGISTER(0x400FE104)
#define RCGC2 REGISTER(0x400FE108)
#define USER_REG0 REGISTER(0x400FE1E0) /* the kit's Ethernet address, its unique number */
#define USER_REG1 REGISTER(0x400FE1E4)
#define RCC_BYPASS (1u << 11)
#define RCC_USESYSDIV (1u << 22)

/* Cortex-M3 */
#define SYSTICK_CTRL REGISTER(0xE000E010)
#define SYSTICK_LOAD REGISTER(0xE000E014)
#define SYSTICK_VAL REGISTER(0xE000E018)
#define NVIC_ENABLE0 REGISTER(0xE000E100)
#define ICSR REGISTER(0xE000ED04)
#define ICSR_PENDSTSET (1u << 26)

/* GPIO: data through an address that masks the pins */
#define PORT_B 0x40005000u
#define PORT_D 0x40007000u
#define PORT_E 0x40024000u
#define PORT_F 0x40025000u
#define PORT_A 0x40004000u
#define GPIO_DATA(port, pins) REGISTER((port) + ((uint32_t)(pins) << 2))
#define GPIO_DIR(port) REGISTER((port) + 0x400)
#define GPIO_BOTH_EDGES(port) REGISTER((port) + 0x408)
#define GPIO_MASK(port) REGISTER((port) + 0x410)
#define GPIO_CLEAR(port) REGISTER((port) + 0x41C)
#define GPIO_ALTERNATE(port) REGISTER((port) + 0x420)
#define GPIO_PULL_UP(port) REGISTER((port) + 0x510)
#define GPIO_DIGITAL(port) REGISTER((port) + 0x51C)

/* Watchdog 0: an interrupt flag at the first zero, a reset at the second */
#define DOG_LOAD REGISTER(0x40000000)
#define DOG_CONTROL REGISTER(0x40000008)
#define DOG_CLEAR REGISTER(0x4000000C)
#define DOG_LOCK REGISTER(0x40000C00)
#define DOG_UNLOCK 0x1ACCE551u

/* UART 0, a PL011 */
#define UART_DATA REGISTER(0x4000C000)
#define UART_FLAGS REGISTER(0x4000C018)
#define UART_IBRD REGISTER(0x4000C024)
#define UART_FBRD REGISTER(0x4000C028)
#define UART_LINE REGISTER(0x4000C02C)
#define UART_CONTROL REGISTER(0x4000C030)
#define UART_LEVELS REGISTER(0x4000C034)
#define UART_MASK REGISTER(0x4000C038)
#define UART_CLEAR REGISTER(0x4000C044)
#define UART_RX_EMPTY (1u << 4)
#define UART_TX_FULL (1u << 5)
#define UART_INT_RX (1u << 4)
#define UART_INT_TIMEOUT (1u << 6)

/* PWM generator 1: outputs 2 (PB0) and 3 (PB1) */
#define PWM_ENABLE REGISTER(0x40028008)
#define PWM1_CTL REGISTER(0x40028080)
#define PWM1_LOAD REGISTER(0x40028090)
#define PWM1_CMPA REGISTER(0x40028098)
#define PWM1_CMPB REGISTER(0x4002809C)
#define PWM1_GENA REGISTER(0x400280A0)
#define PWM1_GENB REGISTER(0x400280A4)

enum interrupt { IRQ_PORT_D = 3, IRQ_PORT_E = 4, IRQ_UART0 = 5 };

#endif
