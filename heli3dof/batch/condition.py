"""The condition of ``--where``, as in ``rig="K1" and plan="rich" and duration_s>30``.

The condition may contain the names in `recording_columns.COLUMNS` (the results table's first
columns), numbers and texts in quotes. Operators are ``= != < <= > >= in``, ``and``, ``or``, ``not``
and parentheses. ``in`` finds a value in a list, ``rig in ("K1", "K2")``, or a part of a column's
text, ``"rich" in plan``. simpleeval evaluates the condition, restricted to these elements. If a
recording has no value in a column, every comparison with this column is false, except ``!=``.
"""

from __future__ import annotations

import ast
import io
import operator
import tokenize
from collections.abc import Callable, Mapping
from typing import Any

from heli3dof.batch.results_table import TEXTS
from heli3dof.errors import UsageError, did_you_mean

SYNTAX = (
    ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.Compare,
    ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn, ast.Name, ast.Load,
    ast.Constant, ast.Tuple, ast.List,
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
    compared = list[ast.expr]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for one, relation, other in zip(sides, node.ops, sides[1:], strict=False):
                _check_comparison(text, one, relation, other)
            compared += node.comparators
    if any(isinstance(n, ast.Tuple | ast.List) and n not in compared for n in ast.walk(tree)):
        raise _faulty(text, "a list stands only after 'in'")
    return expression


def _check_comparison(text: str, one: ast.expr, relation: ast.cmpop, other: ast.expr) -> None:
    """Raise UsageError for a number compared with a text, and for a wrong side of ``in``.

    ``one`` and ``other`` are the sides of a comparison in the condition ``text``.
    """
    parts = other.elts if (is_list := isinstance(other, ast.Tuple | ast.List)) else [other]
    if {True, False} <= {_is_text(side) for side in (one, *parts)}:
        raise _faulty(text, "it compares a number with a text")
    is_in = isinstance(relation, ast.In | ast.NotIn)
    if is_list != is_in and not (is_in and isinstance(other, ast.Name) and _is_text(other)):
        raise _faulty(
            text, """'in' is followed by a list, rig in ("K1", "K2"), or by a column, "K" in rig"""
        )


def _is_text(side: ast.expr) -> bool | None:
    """Return True for a text or a column of texts, False for a number; None if unknown."""
    if isinstance(side, ast.Name):
        return side.id in (*TEXTS, "source")
    if isinstance(side, ast.Constant):
        return None if side.value is None else isinstance(side.value, str)
    return False if isinstance(side, ast.UnaryOp) else None


def holds(expression: str, row: Mapping[str, Any]) -> bool:
    """Return True if a row meets a condition that `checked` returned.

    >>> holds('rig=="K1" and duration_s>30', {"rig": "K1", "duration_s": 63.0})
    True
    >>> holds('rig=="K1" and duration_s>30', {"rig": "K1", "duration_s": None})
    False
    """
    from simpleeval import EvalWithCompoundTypes

    evaluation = EvalWithCompoundTypes(operators=OPERATORS, functions={}, names=dict(row))
    return bool(evaluation.eval(expression))


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
