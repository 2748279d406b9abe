"""The file of an exercise: an encrypted (*sealed*) emulated rig, whose effects students diagnose.

The file is JSON. Two of its fields are encrypted, and have the same length in every exercise:

- ``rig``: what the emulator simulates, encrypted (XSalsa20-Poly1305) with `FLYING_KEY`. That hides
  the effects from view, but a determined programmer finds the key in heli3dof's code.
- ``truth``: the effects and their sizes, in a sealed box (X25519) that only the teacher's private
  key opens.

The field ``signature`` is the teacher's Ed25519 signature of all other fields of the file.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from heli3dof.errors import RecordingError, UsageError, quoted
from heli3dof.file_kind import no_file

FLYING_KEY = blake2b(b"heli3dof.exercise/1, the emulated rig", digest_size=32).digest()
SEALED_SIZE = 1024
"""Bytes of every sealed part before encryption: a length must not show what the part contains"""
LARGEST_FILE = 1_000_000
"""Largest exercise, key or answer file that is read, in bytes; heli3dof's have a few thousand"""
PREFIX = "ex-"
"""Start of the serial number of a sealed rig; the exercise's id follows"""


class Exercise(BaseModel):
    """The content of an exercise file. ``id`` names the exercise in recordings and answers."""

    model_config = ConfigDict(frozen=True, extra="forbid", serialize_by_alias=True)

    form: Literal["heli3dof.exercise/1"] = Field(default="heli3dof.exercise/1", alias="schema")
    id: str = Field(pattern="^[0-9a-f]{12}$")
    level: int = Field(ge=1, le=5)
    teacher: str = Field(pattern="^[0-9a-f]{64}$")
    """Public key that verifies ``signature``"""
    rig: str
    truth: str
    signature: str = Field(default="", pattern="^([0-9a-f]{128})?$")

    @property
    def serial(self) -> str:
        """Return the emulated rig's serial number, which every recording contains."""
        return f"{PREFIX}{self.id}"

    def signed_part(self) -> bytes:
        """Return the signed bytes: all fields of the file except ``signature``, as JSON."""
        return json.dumps(self.model_dump(exclude={"signature"}), sort_keys=True).encode()

    def to_bytes(self) -> bytes:
        return self.model_dump_json(indent=2).encode() + b"\n"

    def is_intact(self) -> bool:
        """Return True if the public key ``teacher`` confirms the signature of this content."""
        check_nacl()
        from nacl.exceptions import CryptoError
        from nacl.signing import VerifyKey

        try:
            key = VerifyKey(bytes.fromhex(self.teacher))
            key.verify(self.signed_part(), bytes.fromhex(self.signature))
        except (CryptoError, ValueError):
            return False
        return True


def exercise_of(serial: str) -> str | None:
    """Return the exercise's id from a sealed rig's serial number; None for another rig's."""
    return serial.removeprefix(PREFIX) if serial.startswith(PREFIX) else None


@dataclass(frozen=True)
class HiddenRig:
    """What the emulator simulates in an exercise: effects and a random spread of parameters.

    ``hide``: the effects; ``spread``: largest relative change of a parameter; both as the options
    of the same name in a URL of ``mock:``. ``rig_seed``: seed of the spread. The URL's seed applies
    to noise, vibration and timing only.
    """

    hide: str
    spread: float
    rig_seed: int


def check_nacl() -> None:
    """Raise UsageError if PyNaCl, an optional dependency, is not installed."""
    try:
        import nacl  # noqa: F401
    except ImportError:
        raise UsageError(
            "Exercises need PyNaCl, which is not installed.",
            cause="it is an optional dependency: only exercises are encrypted.",
            fix="pip install 'heli3dof[teaching]'",
        ) from None


def read_exercise(path: Path) -> Exercise:
    """Return the content of an exercise file.

    Raises UsageError for a missing file, RecordingError for a file that is damaged or was changed.
    """
    try:
        exercise = Exercise.model_validate_json(read_small(path))
    except ValidationError as error:
        raise RecordingError(
            f"{path} is not an exercise.",
            cause="another file, or it was damaged on its way.",
            fix="copy it again from the teacher; heli3dof exercise new makes one",
        ) from error
    if not exercise.is_intact():
        raise RecordingError(
            f"{path} was changed after it was sealed.",
            cause="the teacher's signature does not match its content.",
            fix="copy the file again from the teacher",
        )
    return exercise


def read_small(path: Path) -> bytes:
    """Return the content of a file of at most `LARGEST_FILE` bytes.

    Raises UsageError for a missing file, RecordingError for a folder or a file that is too large
    or cannot be read.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        raise no_file(path) from None
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be read: {error.strerror}.",
            cause="it is a folder, or belongs to another user.",
            fix=f"ls -ld {quoted(path)}",
        ) from error
    if len(data) > LARGEST_FILE:
        raise RecordingError(
            f"{path} has more than {LARGEST_FILE} bytes.",
            cause="another file: exercises and answers are small.",
            fix=f"ls -l {quoted(path)}",
        )
    return data


def padded(part: Mapping[str, Any]) -> bytes:
    """Return ``part`` as JSON to be encrypted, padded with spaces to `SEALED_SIZE` bytes."""
    text = json.dumps(part).encode()
    assert len(text) <= SEALED_SIZE
    return text.ljust(SEALED_SIZE)


def sealed_rig(rig: HiddenRig) -> str:
    """Return ``rig`` as text: encrypted with `FLYING_KEY`, then coded in base64.

    An exercise file stores this text in its field ``rig``.
    """
    check_nacl()
    from nacl.secret import SecretBox

    return base64.b64encode(SecretBox(FLYING_KEY).encrypt(padded(vars(rig)))).decode()


def hidden_rig(exercise: Exercise) -> HiddenRig:
    """Return the decrypted part ``rig`` of an exercise. Raises RecordingError if damaged."""
    check_nacl()
    from nacl.exceptions import CryptoError
    from nacl.secret import SecretBox

    try:
        text = SecretBox(FLYING_KEY).decrypt(base64.b64decode(exercise.rig))
        return HiddenRig(**json.loads(text))
    except (CryptoError, ValueError, TypeError) as error:
        raise RecordingError(
            f"The rig of exercise {exercise.id} cannot be opened.",
            cause="another version of heli3dof made it.",
            fix="install the teacher's version of heli3dof",
        ) from error
