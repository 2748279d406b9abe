"""The condition of ``--where``, as in ``rig="K1" and plan="rich" and duration_s>30``.

The condition may contain the names in `recording_columns.COLUMNS` (the results table's first
columns), numbers and texts in quotes. Operators are ``= != < <= > >= in``, ``and``, ``or``, ``not``
and parentheses. simpleeval evaluates the condition, restricted to these elements. If a recording
has no value in a column, every comparison with this column is false, except ``!=``.
"""

from __future__ import annotations

import ast
import io
import operator
import tokenize
from collections.abc import Callable, Mapping
from typing import Any

from heli3dof.errors import UsageError, did_you_mean

SYNTAX = (
    ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.Compare,
    ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn, ast.Name, ast.Load,
    ast.Constant,
)  # fmt: skip


def _of_values(compare: Callable[[Any, Any], bool]) -> Callable[[Any, Any], bool]:
    """Return ``compare``, changed to return False where it raises TypeError, as for None < 1."""

    def compared(one: Any, other: Any) -> bool:
        try:
            return bool(compare(one, other))
        except TypeError:
            return False

    return compared


OPERATORS = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: _of_values(operator.lt),
    ast.LtE: _of_values(operator.le),
    ast.Gt: _of_values(operator.gt),
    ast.GtE: _of_values(operator.ge),
    ast.In: _of_values(lambda one, other: one in other),
    ast.NotIn: _of_values(lambda one, other: one not in other),
    ast.Not: operator.not_,
    ast.USub: operator.neg,
}


def checked(text: str, columns: Mapping[str, str]) -> str:
    """Return the condition ``text`` as a Python expression. Raises UsageError if it is faulty.

    ``columns``: the names that the condition may contain → their descriptions.
    """
    try:
        expression = _with_double_equals(text)
        tree = ast.parse(expression, mode="eval")
    except (SyntaxError, tokenize.TokenError):
        raise _faulty(text, "it is not a complete condition") from None
    for node in ast.walk(tree):
        if not isinstance(node, SYNTAX):
            raise _faulty(text, f"{type(node).__name__} is not allowed in it")
        if isinstance(node, ast.Name) and node.id not in columns:
            quoted = f"a text stands in quotes ({node.id!r} does not), or a column is misspelt"
            raise UsageError(
                f"--where {text}: there is no column {node.id}.",
                cause=f"{quoted}; {did_you_mean(node.id, columns)}",
                fix="""--where 'rig="K1" and plan="rich"'""",
            )
    return expression


def holds(expression: str, row: Mapping[str, Any]) -> bool:
    """Return True if a row meets a condition that `checked` returned.

    >>> holds('rig=="K1" and duration_s>30', {"rig": "K1", "duration_s": 63.0})
    True
    >>> holds('rig=="K1" and duration_s>30', {"rig": "K1", "duration_s": None})
    False
    """
    from simpleeval import SimpleEval

    return bool(SimpleEval(operators=OPERATORS, functions={}, names=dict(row)).eval(expression))


def _with_double_equals(text: str) -> str:
    """Return ``text`` with ``==`` for ``=``; texts in quotes stay as they are.

    >>> _with_double_equals('rig="a=b" and late_share<=0.1')
    'rig =="a=b"and late_share <=0.1 '
    """
    tokens = tokenize.generate_tokens(io.StringIO(text.strip()).readline)
    pairs = [(t.type, "==" if t.string == "=" else t.string) for t in tokens]
    return tokenize.untokenize(pairs).strip("\n")


def _faulty(text: str, why: str) -> UsageError:
    return UsageError(
        f"--where {text}: {why}.",
        cause="a typing error, or the shell removed the quotes.",
        fix="""quote the whole condition: --where 'rig="K1" and plan="rich"'""",
    )
