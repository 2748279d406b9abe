"""Call the compiled functions of physical effects by their machine addresses.

Compiling the simulation for one set of effects would cost seconds for every candidate of a
diagnosis. Here each effect's function is compiled once and cached on disk (0.2 s the first time,
milliseconds after). The simulations are compiled once and call the active effects through the
functions' addresses, which takes about 2 ns per call.

Each function of an effect has the signature ``f(s, par, mem, out) -> None`` on flat float64 arrays
(`heli3dof.model.physics.state_layout`). Tests call such functions in plain Python, on numpy arrays.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from typing import Any

from heli3dof.plugins import CodeError, source_line

Hook = Callable[[Any, Any, Any, Any], None]


@cache
def _code(function: Hook) -> Any:
    import numba

    pointer = numba.types.CPointer(numba.types.float64)  # type: ignore[no-untyped-call]
    signature = numba.types.void(pointer, pointer, pointer, pointer)
    # numba imports the function's module by its name when it loads cached code.
    module = sys.modules.get(function.__module__)
    importable = module is not None and vars(module) is getattr(function, "__globals__", None)
    try:
        return numba.cfunc(signature, cache=importable, error_model="numpy")(function)
    except Exception as error:  # numba's passes raise errors of many types
        where = source_line(function)
        raise CodeError(f"{where} does not compile: {error}", where) from error


def address(function: Hook) -> int:
    """Return the machine address of an effect's compiled function; the first call compiles it."""
    return int(_code(function).address)


@cache
def caller() -> Any:
    """Return ``call(address, i, s, par, mem, out)``, by which compiled code calls an effect.

    ``call``, a numba intrinsic, calls the effect's function at ``address[i]``. The function gets
    the context s, row i of the parameters ``par``, row i of the memory ``mem``, and ``out``.
    """
    import numba
    from llvmlite import ir
    from numba.extending import intrinsic

    def call(typingctx: Any, address: Any, i: Any, s: Any, par: Any, mem: Any, out: Any) -> Any:
        index = numba.types.intp

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            def array(n: int) -> Any:
                return context.make_array(signature.args[n])(context, builder, args[n])

            def row(n: int) -> Any:
                a = array(n)
                width = builder.extract_value(a.shape, 1)
                return builder.gep(a.data, [builder.mul(args[1], width)])

            where = builder.load(builder.gep(array(0).data, [args[1]]))
            data = [array(2).data, row(3), row(4), array(5).data]
            function = ir.FunctionType(ir.VoidType(), [d.type for d in data])
            # A cfunc has C's calling convention and returns nothing.
            builder.call(builder.inttoptr(where, function.as_pointer()), data)
            return context.get_dummy_value()

        return numba.types.void(address, index, s, par, mem, out), generate

    return intrinsic(call)
