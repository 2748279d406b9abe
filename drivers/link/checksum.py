"""Computes a frame's check: CRC-16 of its bytes, and of its bytes in reverse order.

CRC-16/IBM-3740 ("CCITT-FALSE"): x¹⁶ + x¹² + x⁵ + 1, initial value 0xFFFF, nothing reflected,
nothing inverted; "123456789" gives 0x29B1. This CRC detects every burst of up to 16 bits, and every
one, two or three wrong bits. Any other error passes one CRC-16 with probability 2⁻¹⁶. In reverse
order the wrong bits form a different error polynomial, so this error passes both CRCs with
probability 2⁻³².
"""

from __future__ import annotations

from binascii import crc_hqx

INITIAL = 0xFFFF


def check(data: bytes) -> bytes:
    """Return a frame's last four bytes: the CRC-16 of ``data`` and of ``data`` reversed."""
    return (crc_hqx(data, INITIAL) | crc_hqx(data[::-1], INITIAL) << 16).to_bytes(4, "little")
