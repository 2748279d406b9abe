/* The check of docs/reference/protocol.md: CRC-16/IBM-3740 (polynomial 0x1021, initial 0xFFFF, nothing
 * reflected, nothing inverted), and the same function of the bytes in reverse order.
 * "123456789" gives 0x29B1. */
#ifndef HELI3DOF_CRC16_H
#define HELI3DOF_CRC16_H

#include <stddef.h>
#include <stdint.h>

uint16_t crc16(const uint8_t *bytes, size_t n);
uint16_t crc16_backwards(const uint8_t *bytes, size_t n);

#endif
