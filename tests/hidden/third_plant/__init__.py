"""A laboratory whose equations are written independently of the package and of the emulated rig.

- `body`: kinetics of point masses; `effects`: formulas and sizes of the hidden effects;
- `loop`: integration, controller, encoders, noise; `draw`: rigs, flights, sizes of the effects.

Of heli3dof, it imports only the data that a user hands over: `Recording` with
`recording_of_arrays`, and `Profile` with `profile_from_dict`. Agreement with a diagnosis is
therefore no shared mistake.
"""

import hashlib
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

_DIGEST = hashlib.sha256(
    b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
).hexdigest()


def kernel(function: Callable[..., Any]) -> Any:
    """Compile by ``numba.njit``, cached on disk until a file of this folder changes.

    Of changes, numba only notices those of the function's own file, not of the functions it calls.
    But closure cells belong to its cache key, so the folder's digest becomes one.
    """
    code = function.__code__.replace(co_freevars=("_digest",))
    copy = types.FunctionType(
        code, function.__globals__, function.__name__, None, (types.CellType(_DIGEST),)
    )
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return njit(cache=True)(copy)
