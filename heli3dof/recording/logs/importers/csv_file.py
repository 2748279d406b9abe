"""Importer of CSV logs (``.csv``, ``.csv.gz``, tables in ``.txt`` and ``.tsv``).

The importer also reads a log that has these deviations from a plain table, and adds a note on each:

- semicolons, tabs or spaces between the columns
- decimal commas
- titles above the header line
- a line of units below the header line
- an unnamed first column that numbers the rows
- a column of dates with times (ISO 8601)

numpy parses the whole table at once. If numpy fails, the importer parses the table cell by cell to
find the faulty cell. Its errors name line and column.
"""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from heli3dof.errors import RecordingError, UsageError, quoted
from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.mcap_files.mcap_scan import read_bytes, what_is
from heli3dof.rig.log_columns import KNOWN
from heli3dof.rig.profile import Profile

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}
HEAD_LINES = 50
"""Number of lines in which the header and the first numbers are searched (a convention)"""
LOST_LINES = 0.01
"""Largest share of lines with another number of cells than the header, which count as lost samples;
with more, the file has another format (a convention)"""
EMPTY = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-"}
"""Texts, in lower case, of a cell without a number"""
ENDINGS = (".csv", ".csv.gz")
TEXT_ENDINGS = (".txt", ".tsv")
"""Endings of files that are logs only if they contain a table"""
HEAD_BYTES = 65536
"""Bytes in which a table is searched (a convention)"""
TABLE_CELLS = 3
"""Least number of cells in a line of a table, mostly numbers: time, voltages (a convention)"""


def read(
    path: Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> Table:
    """Return the table of a CSV log, gzipped or not; ``profile`` is not used.

    Raises RecordingError for a faulty file, and UsageError if ``columns`` is not None.
    """
    if columns is not None:
        raise UsageError(
            f"columns is for MAT matrices; {path.name} names its columns in its header line.",
            cause="it was meant for another log.",
            fix="omit columns, or rename the columns in the header line",
        )
    text = _text(path)
    lines = text.splitlines()
    first = next((i for i, x in enumerate(lines) if x.strip() and x.lstrip()[0] != "#"), None)
    if first is None:
        raise RecordingError(
            f"{path} is empty.",
            cause="the logging program stopped before it wrote its first line.",
            fix="record again",
        )
    warnings, notes = list[str](), list[str]()
    if (header := _header_line(lines[first : first + HEAD_LINES])) > 0:
        first += header
        notes.append(f"The header is line {first + 1}; the lines above it were ignored.")
    separator, names = _header(path, lines[first])
    body = lines[first + 1 :]
    numbers = [first + 2 + i for i, x in enumerate(body) if x.strip()]
    body = [x for x in body if x.strip()]
    if separator != ",":
        notes.append(f"Columns are separated by {SEPARATORS[separator]}.")
    if separator != "," and any("," in x for x in body[:50]):
        notes.append("Numbers have decimal commas.")
        body = [x.replace(",", ".") for x in body]
    if names[-1] == "" and all(x.rstrip().endswith(separator) for x in body):
        names = names[:-1]
        body = [x.rstrip().removesuffix(separator) for x in body]
    if units := _units(body, separator, len(names)):
        notes.append(f"Line {numbers[0]} contains units and was skipped.")
        with_units = zip(names, units, strict=True)
        names = [n if n in KNOWN or not u else f"{n} [{u}]" for n, u in with_units]
        body, numbers = body[1:], numbers[1:]
    if names[0] == "" and _are_row_numbers(body, separator):
        notes.append("The first column numbers the rows and has no name; it was ignored.")
        names, body = names[1:], [x.partition(separator)[2] for x in body]
    _check_header(path, names, separator)
    if len(body) > 1 and not text.endswith(("\n", "\r")):
        cells = len(_cells(body[-1], separator))
        if cells < len(names):
            warnings.append(f"The last line ({numbers[-1]}) is incomplete and was ignored.")
            body, numbers = body[:-1], numbers[:-1]

    values = _parse_table(body, separator, names)
    if values is None:
        rows = [_cells(line, separator) for line in body]
        rows, numbers = _complete(path, rows, numbers, separator, names, warnings)
        values = _parse_cells(path, rows, numbers, names, warnings, notes)
    return Table(path.name, values, lambda k: f"line {numbers[k]}", warnings, notes=notes)


def recognises(path: Path) -> bool:
    """Return True if ``path`` ends as CSV logs do, or is a text file with a table of numbers."""
    name = path.name.lower()
    if not name.endswith(TEXT_ENDINGS):
        return name.endswith(ENDINGS)
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    encoding = _two_bytes(head)
    if encoding is None and b"\0" in head:
        return False
    lines = head.decode(encoding or "utf-8", errors="replace").splitlines()[:HEAD_LINES]
    rows = [_cells(line, _separator(line)) for line in lines]
    return any(len(row) >= TABLE_CELLS and _mostly_numbers(row) for row in rows)


def _text(path: Path) -> str:
    data = read_bytes(path)
    if data.startswith(b"\x1f\x8b"):
        try:
            data = gzip.decompress(data)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise RecordingError(
                f"{path} cannot be decompressed: {error}.",
                cause="the copy is incomplete, or the log was still being written.",
                fix=f"gzip -t {quoted(path)}; copy it again",
            ) from error
    if encoding := _two_bytes(data):
        try:
            return data[: len(data) // 2 * 2].decode(encoding)  # a copy may be cut in a character
        except UnicodeDecodeError as error:
            raise RecordingError(
                f"{path} is UTF-16 text up to byte {error.start} only.",
                cause="the file was modified, or two logs were joined.",
                fix="export the log again as CSV in UTF-8",
            ) from error
    if b"\0" in data[:4096]:
        raise RecordingError(
            f"{path} is not a CSV log; it is {what_is(data)}.",
            cause="the file has the wrong ending.",
            fix="rename it to .mcap, .mat or .csv",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")  # a ° or µ in a header; heli3dof's column names are ASCII


def _two_bytes(data: bytes) -> str | None:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    first = data[:512]
    for k, name in ((1, "utf-16-le"), (0, "utf-16-be")):
        if len(first) > 7 and not any(first[k::2]) and all(first[1 - k :: 2]):
            return name
    return None


def _header_line(lines: list[str]) -> int:
    """Return the index of the header line; titles above the header are skipped.

    The first line of data is the first line in which most cells are numbers. The header is the
    first line above it with the same number of cells. Without such a line the result is 0.
    """
    for i, line in enumerate(lines):
        separator = _separator(line)
        rows = [_cells(x, separator) for x in lines[i:]]
        numbers = next((k for k, row in enumerate(rows) if _mostly_numbers(row)), None)
        if numbers == 0:
            break
        if numbers and not line.startswith("#") and len(rows[0]) == len(rows[numbers]):
            return i
    return 0


def _mostly_numbers(row: list[str]) -> bool:
    return 2 * sum(_is_number(cell) for cell in row) > len(row)


def _separator(line: str) -> str:
    counts = {s: line.count(s) for s in ",;\t"}
    separator = max(counts, key=lambda s: counts[s])
    return separator if counts[separator] else " "


def _header(path: Path, line: str) -> tuple[str, list[str]]:
    separator = _separator(line)
    names = [name.strip().strip("\"'").strip() for name in _cells(line, separator)]
    numeric = [_is_number(name) for name in names]
    if names and all(numeric):
        raise RecordingError(
            f"{path} has no header line; its first line starts with the number {names[0]}.",
            cause="the logging program writes numbers only.",
            fix="add a first line with the column names: t_s,v_front_V,v_back_V,roll_deg,…",
        )
    return separator, names


def _are_row_numbers(body: list[str], separator: str) -> bool:
    """Return True if the first cells of all lines are whole numbers that increase, mostly by 1."""
    try:
        numbers = [int(line.partition(separator)[0].strip().strip('"')) for line in body]
    except ValueError:
        return False
    steps = np.diff(numbers)
    return len(steps) > 0 and bool((steps > 0).all()) and float(np.median(steps)) == 1


def _check_header(path: Path, names: list[str], separator: str) -> None:
    for i, name in enumerate(names):
        if name == "":
            raise RecordingError(
                f"{path}: column {i + 1} of the header line has no name.",
                cause=f"two {SEPARATORS[separator]} in a row, or an extra one at the end.",
                fix="name every column",
            )
        if name in names[:i]:
            raise RecordingError(
                f"{path} has two columns {name}.",
                cause="two signals have the same name.",
                fix="rename one of them in the header line",
            )


def _cells(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    return next(csv.reader([line], delimiter=separator), [])


def _parse_table(body: list[str], separator: str, names: list[str]) -> dict[str, np.ndarray] | None:
    if not body:
        return {name: np.empty(0) for name in names}
    try:
        table = np.loadtxt(
            body, delimiter=None if separator == " " else separator, comments=None, ndmin=2
        )
    except ValueError:
        return None
    if table.shape[1] != len(names):
        return None
    return {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)}


def _units(body: list[str], separator: str, count: int) -> list[str]:
    """Return the ``count`` units in the first line below the header; [] if it contains none.

    Each unit may be in brackets.
    """
    cells = _cells(body[0], separator) if len(body) > 1 else []
    units = [re.sub(r"^[\[(]\s*(.*?)\s*[\])]$", r"\1", cell.strip()) for cell in cells]
    is_text = len(units) == count and not any(_is_number(u) for u in units)
    if not is_text or all(u.lower() in EMPTY for u in units):
        return []
    return units if _mostly_numbers(_cells(body[1], separator)) else []


def _complete(
    path: Path, rows: list[list[str]], numbers: list[int], separator: str, names: list[str],
    warnings: list[str],
) -> tuple[list[list[str]], list[int]]:  # fmt: skip
    """Return the rows that have as many cells as the header line, and their line numbers.

    ``rows``: the cells of each line; ``numbers``: the line numbers; ``names``: the names in the
    header line. The function leaves out all other rows as lost samples. It appends a warning to
    ``warnings`` that states how many rows it left out. Raises RecordingError if the share of these
    rows exceeds `LOST_LINES`.
    """
    wrong = [k for k, row in enumerate(rows) if len(row) != len(names)]
    if not wrong:
        return rows, numbers
    first = numbers[wrong[0]]
    if len(wrong) > LOST_LINES * len(rows):
        raise _ragged(path, first, rows[wrong[0]], names, separator)
    warnings.append(
        f"{len(wrong)} of {len(rows)} lines do not have {len(names)} cells and were left out as "
        f"lost samples; the first is line {first}."
    )
    kept = np.delete(np.arange(len(rows)), wrong)
    return [rows[k] for k in kept], [numbers[k] for k in kept]


def _parse_cells(
    path: Path, rows: list[list[str]], numbers: list[int], names: list[str], warnings: list[str],
    notes: list[str],
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return the log's columns, parsed cell by cell. An empty cell becomes NaN.

    ``rows``: the cells of each line; ``numbers``: the lines' numbers; ``names``: the columns'
    names. A column may contain cells that are no numbers:

    * A column of dates with times becomes seconds since its first date. The function appends a text
      about this to ``notes``.
    * A column with other text is left out if heli3dof does not use a column of this name. The
      function appends a text about this to ``warnings``.
    * Text in a column that heli3dof uses raises RecordingError.
    """
    columns: dict[str, np.ndarray] = {}
    for i, name in enumerate(names):
        cells = [row[i].strip() for row in rows]
        values = [_value(cell) for cell in cells]
        if None not in values:
            columns[name] = np.array(values, dtype=float)
            continue
        k = values.index(None)
        if dates := _dates(cells):
            columns[name] = np.array([(date - dates[0]).total_seconds() for date in dates])
            notes.append(f"{name} contains dates; it was read as seconds from {dates[0]} on.")
        elif name in KNOWN:
            raise RecordingError(
                f"{path}: line {numbers[k]}, column {name}: {cells[k]!r} is not a number.",
                cause="a unit, a comment or an error message among the numbers.",
                fix=f"remove line {numbers[k]}, or write a number there",
            )
        else:
            warnings.append(
                f"The column {name} holds text ({cells[k]!r} in line {numbers[k]}); "
                "it was ignored, because channels are numeric."
            )
    return columns


def _value(cell: str) -> float | None:
    """Return the number in a cell, NaN for an empty one, None for text."""
    if cell.lower() in EMPTY:
        return np.nan
    try:
        return float(cell)
    except ValueError:
        return None


def _dates(cells: list[str]) -> list[datetime]:
    """Return the dates with times in ``cells`` (ISO 8601); [] if a cell contains anything else."""
    try:
        dates = [datetime.fromisoformat(cell) for cell in cells]
    except ValueError:
        return []
    return dates if len({date.tzinfo is None for date in dates}) == 1 else []


def _ragged(
    path: Path, number: int, row: list[str], names: list[str], separator: str
) -> RecordingError:
    line = separator.join(row)
    others = [s for s in SEPARATORS if s != separator and len(_cells(line, s)) == len(names)]
    if others:
        cause = f"its cells are separated by {SEPARATORS[others[0]]}, the header's by " + (
            f"{SEPARATORS[separator]}."
        )
        fix = "write the same separator in every line"
    elif separator == "," and len(row) > len(names) and not any("." in cell for cell in row):
        cause = "decimal commas in a table separated by commas."
        fix = "export with decimal points, or with semicolons between the columns"
    else:
        cause = "two programs wrote the line at once, or it is incomplete."
        fix = f"correct line {number} of {path.name}"
    return RecordingError(
        f"{path}: line {number} has {len(row)} cell{'s' * (len(row) != 1)}, "
        f"the header line {len(names)}.",
        cause=cause,
        fix=fix,
    )


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


IMPORTER = Importer("CSV", ENDINGS, read, recognises=recognises)
