"""Find the recordings that a batch is to work on: files, folders, patterns, lists and URLs.

====================  ===========================================================
argument              recordings
====================  ===========================================================
``flight.mcap``       this file
``term-1/``           all recordings and logs in the folder and its subfolders
``'term-1/*.mcap'``   the files that match the pattern; ``**`` stands for any folders
``list.txt``, ``-``   a path, pattern or URL in each line of the file, or of stdin
``s3://lab/*.mcap``   a URL or pattern of any file system of fsspec
====================  ===========================================================
"""

from __future__ import annotations

import glob
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heli3dof.batch.output_folder import is_output_folder
from heli3dof.batch.results_table import CSV
from heli3dof.errors import RecordingError, UsageError, quoted
from heli3dof.file_kind import no_file
from heli3dof.recording.atomic_write import stem
from heli3dof.recording.logs.importers import endings
from heli3dof.recording.mcap_files.mcap_scan import refuse_stream
from heli3dof.results import optional

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem

LIST = ".txt"
"""Ending of a file that lists recordings, one a line"""


@dataclass(frozen=True)
class Source:
    """The path or URL of a recording, as the user gave it."""

    where: str

    @property
    def is_url(self) -> bool:
        return "://" in self.where

    @property
    def file_name(self) -> str:
        return self.where.rsplit("/", 1)[-1] if self.is_url else Path(self.where).name

    @property
    def name(self) -> str:
        """Return the recording's name: the file name without its ending."""
        return stem(Path(self.file_name))

    def fingerprint(self) -> str:
        """Return a hash that changes with the file's content; empty if the file cannot be read.

        For a URL, the hash is the checksum that the file system gives, so the content need not be
        transferred. On S3 this checksum covers the ETag, the size and the date.
        """
        try:
            if self.is_url:
                files, path = _file_system(self.where)
                return f"{files.checksum(path)}"
            if not Path(self.where).is_file():
                return ""
            with open(self.where, "rb") as stream:
                return hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError:
            return ""

    def read(self) -> bytes:
        """Return the file's content. Raises RecordingError or UsageError if it cannot be read."""
        try:
            if self.is_url:
                files, path = _file_system(self.where)
                return bytes(files.cat_file(path))
            refuse_stream(Path(self.where))
            return Path(self.where).read_bytes()
        except FileNotFoundError:
            if self.is_url:
                raise RecordingError(
                    f"There is no file {self.where}.", cause="a typing error in the URL."
                ) from None
            raise no_file(Path(self.where), "recording", RecordingError) from None
        except OSError as error:
            raise RecordingError(
                f"{self.where} cannot be read: {error.strerror or error}.",
                cause="it belongs to another user, is a folder, or the network failed.",
            ) from None


def find(words: Sequence[str]) -> list[Source]:
    """Return the recordings that the command's arguments ``words`` name, without duplicates.

    They are in the order of the arguments; those of one folder or pattern are sorted by path. A
    file given by its own path, with a recording's ending, need not exist: its row of the results
    table then states the error. Raises UsageError for a folder, pattern or list without any
    recording.
    """
    found = dict.fromkeys(each for word in words for each in _expanded(word))
    return [Source(each) for each in found]


def _expanded(word: str) -> list[str]:
    if word == "-" or (word.endswith(LIST) and "://" not in word):
        lines = [line.strip() for line in _lines(word)]
        listed = [line for line in lines if line and not line.startswith("#")]
        return _not_empty([p for line in listed for p in _expanded(line)], word, "list")
    if "://" in word:
        if not glob.has_magic(word):
            return [word]
        files, path = _file_system(word)
        matches = sorted(files.unstrip_protocol(p) for p in files.glob(path))
        return _not_empty(matches, word, "pattern")
    if Path(word).is_dir():
        return _not_empty(sorted(map(str, _in_folder(Path(word)))), word, "folder")
    if glob.has_magic(word) and not Path(word).exists():
        return _not_empty(sorted(glob.glob(word, recursive=True)), word, "pattern")
    is_file = Path(word).exists() or word.lower().endswith((".mcap", *endings()))
    return [word] if is_file else _not_empty([], word, "folder")


def _lines(word: str) -> Iterable[str]:
    if word == "-":
        return sys.stdin.read().splitlines()
    try:
        return Path(word).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        raise no_file(Path(word)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(
            f"The list {word} cannot be read: {error}.",
            cause="it is not a text file with one recording a line.",
            fix=f"ls /data/*.mcap > {quoted(word)}",
        ) from None


def _in_folder(folder: Path) -> Iterator[Path]:
    """Yield the recordings and logs in a folder and its subfolders, except hidden ones.

    The results table of a batch is no log.
    """
    wanted = (".mcap", *endings())
    table = CSV if is_output_folder(folder) else None
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name == table:
            continue
        if path.is_dir():
            yield from _in_folder(path)
        elif path.name.lower().endswith(wanted):
            yield path


def _not_empty(found: list[str], word: str, kind: str) -> list[str]:
    if not found:
        known = ", ".join(sorted({".mcap", *endings()}))
        raise UsageError(
            f"There is no recording in the {kind} {word}.",
            cause=f"a typing error, or other endings than {known}.",
            fix=f"ls {_quoted_pattern(word)}",
        )
    return found


def _quoted_pattern(word: str) -> str:
    """Return a path or pattern quoted for a shell, except ``*``, ``?`` and ``[…]``."""
    return re.sub(r"[^*?[\]]+", lambda part: quoted(part[0]), word)


def _file_system(url: str) -> tuple[AbstractFileSystem, str]:
    """Return a URL's file system, and the path in it.

    Raises UsageError if fsspec does not support this kind of URL.
    """
    fsspec: Any = optional("fsspec", extra="cluster")
    try:
        files, path = fsspec.url_to_fs(url)
    except (ValueError, ImportError) as error:
        raise UsageError(
            f"{url} cannot be opened: {error}.",
            cause="fsspec does not know the URL's scheme, or its library is not installed.",
            fix="pip install s3fs, for s3:// (gcsfs for gs://, adlfs for abfs://)",
        ) from None
    return files, str(path)
