"""Print in any encoding: characters that the encoding lacks are replaced by ASCII text.

====================  ====================================  ==============================
character             written as                            from
====================  ====================================  ==============================
``°`` ``−`` ``→`` …   ``deg`` ``-`` ``->`` …                `ASCII`
``²`` ``⁻¹`` ``é``    ``^2`` ``^-1`` ``e``                  Unicode's compatibility forms
``ψ`` ``Δ``           ``psi`` ``Delta``                     Unicode's character names
byte of a file name   ``\\xff``                              PEP 383's surrogates
anything else         ``\\u65e5``                            Python's own escape
====================  ====================================  ==============================

A character that the encoding has is kept: cp1252 prints ``°``. `prepare` applies this replacement
to everything the process prints, other libraries included. `printable` applies it to text in
columns, before the text's width is measured.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import sys
from typing import TextIO

from heli3dof.errors import NoSpace

HANDLER = "heli3dof.ascii"
"""The name of the codec error handler"""
ASCII = {
    "°": "deg", "µ": "u", "μ": "u", "·": ".", "−": "-", "–": "-", "—": "-", "±": "+/-", "×": "x",
    "÷": "/", "→": "->", "←": "<-", "↦": "->", "…": "...", "≤": "<=", "≥": ">=", "≠": "!=",
    "≈": "~", "∝": "~", "∞": "inf", "√": "sqrt", "∫": "int", "∂": "d", "⁄": "/", "′": "'",
    "″": '"', "‘": "'", "’": "'", "“": '"', "”": '"', "«": '"', "»": '"', "⟨": "<", "⟩": ">",
    "†": "+", "‖": "||", "•": "*", "─": "-", "━": "-", "│": "|", "┃": "|", "├": "+", "└": "+",
    "❱": ">", "\u00a0": " ", "\u2009": " ", "\u202f": " ",
    "ß": "ss", "æ": "ae", "ø": "o", "ł": "l",
    "\u0307": "_dot", "\u0308": "_ddot", "\u0302": "_hat", "\u0304": "_bar",
}  # fmt: skip
"""Symbols that heli3dof prints → ASCII text. ``N.m.s/rad`` follows UCUM, the code for units."""


def prepare() -> None:
    """Make stdout and stderr print ASCII text for the characters that their encoding lacks.

    A closed stream (``2>&-``) is opened on the null device. Otherwise the next file to be opened,
    perhaps a recording, would get the stream's descriptor. Libraries would then print their
    messages into that file.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            with contextlib.suppress(OSError):
                os.fstat(number)
                continue
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number
            stream = open(number, "w" if number else "r", encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)
    codecs.register_error(HANDLER, _replace)
    for each in (sys.stdout, sys.stderr):
        reconfigure = getattr(each, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=HANDLER)


def finish(code: str | int | None) -> str | int | None:
    """Flush stdout and stderr; return ``code``, or an error's exit code if output was not written.

    It is no error if the program that reads the output, such as ``head``, ended first.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None and not stream.closed:
                stream.flush()
        except BrokenPipeError:
            _discard(stream)
        except OSError as error:
            _discard(stream)
            code = print_lost_output(error)
    return code


def lost_output(error: OSError) -> NoSpace:
    """Return the heli3dof error for output that could not be written because of ``error``."""
    return NoSpace(
        f"The output cannot be written: {error.strerror}.",
        cause="the disk is full.",
        fix="df -h; files that the command wrote itself are complete",
    )


def print_lost_output(error: OSError) -> int:
    """Print that the output could not be written because of ``error``; return the exit code."""
    with contextlib.suppress(OSError):
        print(f"Error: {lost_output(error)}", file=sys.stderr)
    return NoSpace.exit_code


def reader_has_gone(end: SystemExit) -> bool:
    """Return True if the process ends (``end``) because the program that reads its output ended."""
    return isinstance(end.__context__, BrokenPipeError)


def _discard(stream: TextIO) -> None:
    """Redirect ``stream`` to the null device, so that flushing it at exit cannot fail."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def printable(text: str, encoding: str | None) -> str:
    """Return the text with ASCII in place of the characters that the ``encoding`` lacks.

    >>> printable("5 °/s, χ² ≤ 2, ψ in cp1252", "ascii")
    '5 deg/s, chi^2 <= 2, psi in cp1252'
    """
    if text.isascii():
        return text
    codecs.register_error(HANDLER, _replace)
    encoding = encoding or "ascii"
    return text.encode(encoding, HANDLER).decode(encoding)


def is_ascii_or_utf(text: str, encoding: str | None) -> bool:
    """Return True if ``text`` is ASCII, or ``encoding`` is a UTF (UTF-8, …) and can encode it."""
    if not (encoding or "").lower().replace("_", "-").startswith("utf"):
        return text.isascii()
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _replace(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return _in_ascii(error.object[error.start : error.end]), error.end


def _in_ascii(text: str) -> str:
    """Return ``text`` in ASCII, such as ``chi^2`` for ``χ²``; ``²³`` becomes ``^23``."""
    joined = "".join(map(_one_in_ascii, text))
    return re.sub(r"(?<=\^[-+\dn])\^(?=[-+\dn])", "", joined)


def _one_in_ascii(c: str) -> str:
    import unicodedata

    if c.isascii():
        return c
    if c in ASCII:
        return ASCII[c]
    if "\udc80" <= c <= "\udcff":
        return f"\\x{ord(c) - 0xDC00:02x}"
    form, _, simple = unicodedata.decomposition(c).rpartition(">")
    if simple:
        parts = [chr(int(code, 16)) for code in simple.split()]
        if not form:  # a letter with diacritics: keep the letter
            parts = [p for p in parts if not unicodedata.combining(p)]
        plain = "".join(map(_one_in_ascii, parts))
        return f"^{plain}" if form == "<super" else plain
    name = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", unicodedata.name(c, ""))
    if name is not None:
        return name[2].lower() if name[1] == "SMALL" else name[2].capitalize()
    return c.encode("ascii", "backslashreplace").decode("ascii")
