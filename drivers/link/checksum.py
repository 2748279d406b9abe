"""The check of a frame: CRC-16 of its bytes, and of the same bytes taken backwards.

CRC-16/IBM-3740 ("CCITT-FALSE"): x¹⁶ + x¹² + x⁵ + 1, initial value 0xFFFF, nothing reflected,
nothing inverted; "123456789" gives 0x29B1. It sees every burst of up to 16 bits and every one, two
or three wrong bits. What is damaged more passes one CRC-16 with 2⁻¹⁶, fifteen times in a million
frames; backwards the same wrong bits are another polynomial, so both let through 2⁻³².
"""

from __future__ import annotations

from binascii import crc_hqx

INITIAL = 0xFFFF


def crc16(data: bytes) -> int:
    """
    >>> hex(crc16(b"123456789"))
    '0x29b1'
    """
    return crc_hqx(data, INITIAL)


def check(data: bytes) -> bytes:
    """The four bytes that end a frame: crc16 forwards, crc16 backwards, little-endian."""
    return (crc_hqx(data, INITIAL) | crc_hqx(data[::-1], INITIAL) << 16).to_bytes(4, "little")
