"""The teacher's private key, which signs exercises and decrypts their hidden effects.

It is an Ed25519 key of 32 bytes; converted to X25519, it decrypts the hidden effects. The key, a
seed and the level determine which effects are drawn. So a student who knows seed and level, but not
the key, cannot draw the same effects.
"""

from __future__ import annotations

import base64
import json
import os
import secrets
import stat
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING

from heli3dof.errors import RecordingError, UsageError
from heli3dof.exercise.levels import Cause, draw
from heli3dof.rig.sealed_rig import Exercise, HiddenRig, check_nacl, padded, read_small, sealed_rig
from heli3dof.rig.session.paths import state_folder

if TYPE_CHECKING:
    from nacl.signing import SigningKey

FORM = "heli3dof.teacher_key/1"


@dataclass(frozen=True)
class Truth:
    """The hidden effects of an exercise, and the rig's spread.

    ``spread``: largest relative difference of the rig's parameters from the profile.
    """

    causes: tuple[Cause, ...]
    spread: float


def default_key() -> Path:
    """Return the path of the key file, in the user's state folder, if ``--key`` is omitted."""
    return state_folder() / "teacher.key"


def new_key(path: Path) -> None:
    """Write a new key to the file ``path``, readable by this user only.

    Raises OSError if the file exists.
    """
    content = {"schema": FORM, "private_key": secrets.token_hex(32)}
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
        stream.write(json.dumps(content) + "\n")
        stream.flush()
        os.fsync(stream.fileno())


def load_key(path: Path) -> SigningKey:
    """Return the teacher's key in the file ``path``.

    Raises UsageError for a missing file, RecordingError for a file that is not a key.
    """
    check_nacl()
    from nacl.signing import SigningKey

    if not path.exists():
        raise UsageError(
            f"There is no teacher's key {path}.",
            cause="no exercise was made on this computer, or the key was moved.",
            fix="--key FILE; heli3dof exercise new makes a key with the first exercise",
        )
    try:
        data = json.loads(read_small(path))
        if data["schema"] != FORM:
            raise ValueError(data["schema"])
        return SigningKey(bytes.fromhex(data["private_key"]))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise RecordingError(
            f"{path} is not a teacher's key.",
            cause="another file, or only a part of the key.",
            fix="a backup of the key; exercises that it sealed cannot be opened without it",
        ) from error


def others_can_read(path: Path) -> bool:
    """Return True if users other than the owner may read the key file (on Windows always False)."""
    return os.name != "nt" and bool(path.stat().st_mode & (stat.S_IRGRP | stat.S_IROTH))


def seal(key: SigningKey, seed: int, level: int) -> Exercise:
    """Return a new exercise with effects drawn at random, encrypted and signed with ``key``.

    ``level``: its difficulty. The same key, seed and level hide the same effects.
    """
    import numpy as np
    from nacl.public import SealedBox

    def derived(purpose: str, size: int) -> bytes:
        text = f"{purpose}/{seed}/{level}".encode()
        return blake2b(text, key=bytes(key), digest_size=size).digest()

    rng = np.random.default_rng(int.from_bytes(derived("draw", 32), "big"))
    causes, spread = draw(level, rng)
    rig = HiddenRig(",".join(c.text for c in causes), spread, int(rng.integers(2**31)))
    truth = {"spread": spread, "causes": [[c.name, dict(c.values)] for c in causes]}
    box = SealedBox(key.to_curve25519_private_key().public_key)
    exercise = Exercise(
        id=derived("id", 6).hex(),
        level=level,
        teacher=bytes(key.verify_key).hex(),
        rig=sealed_rig(rig),
        truth=base64.b64encode(box.encrypt(padded(truth))).decode(),
    )
    signature = key.sign(exercise.signed_part()).signature.hex()
    return exercise.model_copy(update={"signature": signature})


def signature_problem(key: SigningKey, exercise: Exercise) -> str | None:
    """Return None if ``key`` signed this exercise as it is, else why the signature is wrong."""
    if not exercise.is_intact():
        return "the exercise in it was changed after it was sealed"
    if exercise.teacher != bytes(key.verify_key).hex():
        return "another teacher's key sealed the exercise"
    return None


def open_truth(key: SigningKey, exercise: Exercise) -> Truth:
    """Return the hidden effects of an exercise, decrypted with the teacher's ``key``.

    Raises RecordingError if this key did not sign the exercise, or if the exercise was changed.
    """
    if (why := signature_problem(key, exercise)) is not None:
        raise RecordingError(
            f"Exercise {exercise.id} cannot be opened: {why}.",
            cause="the wrong key, or a file that was changed.",
            fix="--key with the file that exercise new named",
        )
    from nacl.public import SealedBox

    box = SealedBox(key.to_curve25519_private_key())
    data = json.loads(box.decrypt(base64.b64decode(exercise.truth)))
    return Truth(tuple(Cause(n, v) for n, v in data["causes"]), data["spread"])
