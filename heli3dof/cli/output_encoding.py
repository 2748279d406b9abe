"""Output in whatever encoding the terminal or the file has: symbols become ASCII, none is lost.

====================  ====================================  ==============================
character             written as                            from
====================  ====================================  ==============================
``°`` ``−`` ``→`` …   ``deg`` ``-`` ``->`` …                `ASCII`
``²`` ``⁻¹`` ``é``    ``^2`` ``^-1`` ``e``                  Unicode's compatibility forms
``ψ`` ``Δ``           ``psi`` ``Delta``                     Unicode's character names
byte of a file name   ``\\xff``                              PEP 383's surrogates
anything else         ``\\u65e5``                            Python's own escape
====================  ====================================  ==============================

Only a character that the encoding lacks is replaced: cp1252 keeps its ``°``. `prepare` does this
for everything that the process prints, other libraries' output included; `printable` does it for
text that is laid out in columns, before its width is measured.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import sys
from typing import TextIO

from heli3dof.errors import RecordingError

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
"""The symbols we print; ``N.m.s/rad`` is how UCUM, the code of units for machines, writes it"""


def prepare() -> None:
    """Let standard output and standard error take every character, in whatever encoding.

    One that was closed (``2>&-``) goes nowhere. Its number must not be left free: the next file
    that is opened, a recording say, would get it, and what libraries print to stderr with it.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            with contextlib.suppress(OSError):
                os.fstat(number)
                continue
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free
            stream = open(number, "w" if number else "r", encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)
    codecs.register_error(HANDLER, _replace)
    for each in (sys.stdout, sys.stderr):
        reconfigure = getattr(each, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=HANDLER)


def finish(code: str | int | None) -> str | int | None:
    """The exit code, after everything printed has left the process.

    A reader that has gone, as `head` does, changes nothing; output that is lost is an error.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None and not stream.closed:
                stream.flush()
        except BrokenPipeError:
            _discard(stream)
        except OSError as error:
            _discard(stream)
            code = lost(error)
    return code


def lost(error: OSError) -> int:
    """Say on stderr that the output of the program could not be written; its exit code."""
    with contextlib.suppress(OSError):
        print(f"Error: The output cannot be written: {error.strerror}.", file=sys.stderr)
        print("Likely cause: the disk that it was sent to is full.", file=sys.stderr)
        print("Try: df -h; what the verb wrote to files of its own is whole", file=sys.stderr)
    return RecordingError.exit_code


def reader_has_gone(end: SystemExit) -> bool:
    """Whether a library ended the process because nothing reads its output, of ``--help`` say."""
    return isinstance(end.__context__, BrokenPipeError)


def _discard(stream: TextIO) -> None:
    """Let what the stream still holds go nowhere, so that the interpreter's end can flush it."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)


def printable(text: str, encoding: str | None) -> str:
    """The text with what the encoding lacks in ASCII.

    >>> printable("5 °/s, χ² ≤ 2, ψ in cp1252", "ascii")
    '5 deg/s, chi^2 <= 2, psi in cp1252'
    """
    if text.isascii():
        return text
    codecs.register_error(HANDLER, _replace)
    encoding = encoding or "ascii"
    return text.encode(encoding, HANDLER).decode(encoding)


def carries(text: str, encoding: str | None) -> bool:
    """Whether a Unicode stream of this encoding holds the text as it is."""
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
    """Superscripts that stand together have one sign of a power."""
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
        if not form:  # a letter with its marks: the letter
            parts = [p for p in parts if not unicodedata.combining(p)]
        plain = "".join(map(_one_in_ascii, parts))
        return f"^{plain}" if form == "<super" else plain
    name = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", unicodedata.name(c, ""))
    if name is not None:
        return name[2].lower() if name[1] == "SMALL" else name[2].capitalize()
    return c.encode("ascii", "backslashreplace").decode("ascii")
