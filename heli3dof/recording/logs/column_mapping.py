"""Compute a recording's columns from those of another program's log: ``roll_deg = 57.2958*x[5]``.

An expression contains numbers, ``+ - * / **``, parentheses, `FUNCTIONS`, ``pi``, unchanged names
of the log's columns (``Vf (V)``, ``x[5]``), and ``sample``, the number of the sample from 0. A name
that the log does not have may be another mapped column. simpleeval evaluates the expressions; it is
restricted to these elements, so that another person's profile cannot run code.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from heli3dof.errors import Heli3dofError, RecordingError, UsageError, did_you_mean, listed, nearest
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.known_names import without_unit
from heli3dof.rig.log_columns import KNOWN, VOLTAGE_COLUMNS

LISTED = 12
"""Largest number of column names in a message"""


def _restricted(name: str, arguments: int = 1) -> Callable[..., Any]:
    """Return numpy's function ``name``, restricted to ``arguments`` arguments.

    Further arguments, such as ``out``, could change arrays.
    """

    def call(*values: Any) -> Any:
        if len(values) != arguments:
            raise TypeError(f"{name} takes {arguments} value{'s' * (arguments != 1)}")
        return getattr(np, name)(*values)

    return call


def _unwrap(*values: Any) -> Any:
    """Return an angle (N,) without jumps of a whole turn.

    A turn is 360 if the values span more than 1.01 · 2π, because wrapped radians span at most 2π.
    Otherwise it is 2π.
    """
    if len(values) != 1:
        raise TypeError("unwrap takes 1 value")
    angle = np.asarray(values[0], dtype=float)
    finite = angle[np.isfinite(angle)]
    in_radians = not finite.size or np.ptp(finite) < 1.01 * 2 * np.pi  # rounded numbers
    return np.unwrap(angle, period=2 * np.pi if in_radians else 360.0)


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    name: _restricted(name) for name in ("abs", "cos", "degrees", "radians", "sin", "sqrt", "tan")
} | {"clip": _restricted("clip", 3), "unwrap": _unwrap}
OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.true_divide,
    ast.Pow: np.float_power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
SYNTAX = (ast.Name, ast.UnaryOp, ast.BinOp, ast.Call, ast.Constant)


def parse_mapping(words: Sequence[str]) -> dict[str, str]:
    """Return the mapping column → expression that the options ``--map COLUMN=EXPRESSION`` state.

    >>> parse_mapping(["v_front_V=(Vs-Vd)/2", "pitch_rad = -x[3]"])
    {'v_front_V': '(Vs-Vd)/2', 'pitch_rad': '-x[3]'}
    """
    mapping: dict[str, str] = {}
    for word in words:
        name, equals, expression = (part.strip() for part in word.partition("="))
        if not equals or not expression:
            raise UsageError(
                f"--map {word} is not COLUMN=EXPRESSION.",
                cause="the equals sign or the expression is missing, or the shell split the words.",
                fix="quote it: --map 'v_front_V=(Vs-Vd)/2'",
            )
        _check_target(name)
        if name in mapping:
            raise UsageError(
                f"--map names {name} twice.", cause="a typing error.", fix="remove one of the two"
            )
        mapping[name] = expression
    return mapping


def _check_target(name: str) -> None:
    if name not in KNOWN:
        raise UsageError(
            f"--map {name}: a recording has no column {name}.",
            cause=f"a typing error; {did_you_mean(name, KNOWN)}",
            fix="--map OUR_COLUMN=EXPRESSION_OF_THE_LOG; heli3dof keeps all other columns",
        )


def mapped(table: Table, given: Mapping[str, str], profile: Mapping[str, str]) -> Table:
    """Return ``table`` with the columns that the mappings compute, added or replaced.

    ``given``: column → expression from the command line. ``profile``: column → expression from the
    profile's ``[log]``. If both compute the same column, ``given`` has priority.

    * An expression in ``profile`` may use a name that the log does not have. The function ignores
      such an expression if the log already contains the column to be computed.
    * The function drops the log's columns that the expressions use. It keeps such a column if
      docs/reference/recording.md lists its name and no mapping replaces it.

    Raises UsageError for a faulty expression in ``given``, RecordingError for one in ``profile``.
    """
    for name in given:
        _check_target(name)
    stems = set(map(without_unit, given))
    entries = {n: e for n, e in profile.items() if without_unit(n) not in stems} | dict(given)
    mapping = _Mapping(table, entries, given.keys())
    columns: dict[str, np.ndarray] = {}
    ignored = list(table.ignored)
    for name in entries:
        if name not in given and name in table.columns and mapping.unknown(name):
            ignored.append(f"[log] {name} of the profile: the log has its own column {name}")
            continue
        columns[name] = mapping.value(name)
    mapping.used.add(table.origins.get("t_s", "t_s"))
    kept = {n: v for n, v in table.columns.items() if n in KNOWN or n not in mapping.used}
    stems = set(map(without_unit, columns))
    for name in [n for n in kept if n in KNOWN and without_unit(n) in stems]:
        del kept[name]
        if name not in mapping.used:
            ignored.append(f"{name} of the log: replaced by the mapping")
    origins = {**table.origins, **{name: entries[name] for name in columns}}
    return replace(table, columns={**columns, **kept}, origins=origins, ignored=ignored)


class _Mapping:
    """Evaluates the expressions of a mapping; ``used``: names of the log's columns used in them."""

    def __init__(self, table: Table, entries: Mapping[str, str], given: Any) -> None:
        self.table, self.entries, self.given = table, entries, given
        self.used: set[str] = set()
        self._results: dict[str, np.ndarray] = {}
        self._pending: list[str] = []
        names = sorted({*table.columns, *table.paths, *entries, "sample"}, key=len, reverse=True)
        words = "|".join(re.escape(n) for n in names if re.search(r"[^\W\d]", n))
        self._names = re.compile(rf"(?<![\w.\]])(?:{words})(?![\w(\[])")

    def unknown(self, target: str) -> list[str]:
        """Return the unknown names in the expression for the column ``target`` (`_unknown`)."""
        return _unknown(self._parsed(target)[0])

    def value(self, target: str) -> np.ndarray:
        """Return the values (N,) of the column ``target``."""
        if target in self._results:
            return self._results[target]
        if target in self._pending:
            raise self._error(
                target, "refers to itself: " + " → ".join([*self._pending, target]),
                "the log has no column of that name.", "name a column of the log",
            )  # fmt: skip
        tree, names = self._parsed(target)
        if unknown := _unknown(tree):
            raise self._no_column(target, unknown[0])
        self._pending.append(target)
        values = {place: self._values_of(name, target) for place, name in names.items()}
        self._pending.pop()
        self.used |= set(names.values()) & self.table.columns.keys()
        self._results[target] = self._evaluated(target, tree, values)
        return self._results[target]

    def _values_of(self, name: str, target: str) -> np.ndarray:
        if target in VOLTAGE_COLUMNS and name in self.table.means:
            return self.table.means[name]
        if name in self.table.columns:
            return self.table.columns[name]
        return self.value(name) if name in self.entries else np.arange(len(self.table), dtype=float)

    def _parsed(self, target: str) -> tuple[ast.expr, dict[str, str]]:
        """Return the syntax tree of the expression for ``target``, and a dict of its placeholders.

        In the expression, placeholders replace the names of columns, because these names need not
        be valid identifiers. The dict maps placeholder → column name.
        """
        places: dict[str, str] = {}

        def place(match: re.Match[str]) -> str:
            return places.setdefault(match.group(), f"_{len(places)}_")

        text = self._names.sub(place, self.entries[target])
        try:
            tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            reason = error.msg if isinstance(error, SyntaxError) else str(error)
            raise self._error(
                target, f"is not an expression ({reason})", "a missing parenthesis or operator.",
                f"numbers, columns, parentheses, + - * / **, pi and {', '.join(sorted(FUNCTIONS))}",
            ) from None  # fmt: skip
        return tree, {p: self.table.paths.get(name, name) for name, p in places.items()}

    def _evaluated(
        self, target: str, tree: ast.expr, values: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        from simpleeval import InvalidExpression, SimpleEval

        names = {"pi": np.pi, **values}
        evaluator = SimpleEval(operators=OPERATORS, functions=dict(FUNCTIONS), names=names)
        evaluator.nodes = {kind: evaluator.nodes[kind] for kind in SYNTAX}
        try:
            with np.errstate(all="ignore"):
                result = evaluator.eval(self.entries[target], previously_parsed=tree)
                return np.array(np.broadcast_to(np.asarray(result, dtype=float), len(self.table)))
        except (InvalidExpression, TypeError, ValueError, ArithmeticError, RecursionError) as error:
            raise self._error(
                target, f"cannot be computed ({error})", "an operation that is not available.",
                f"numbers, columns, parentheses, + - * / **, pi and {', '.join(sorted(FUNCTIONS))}",
            ) from None  # fmt: skip

    def _no_column(self, target: str, name: str) -> Heli3dofError:
        columns = list(self.table.columns)
        rows = [c for c in columns if c.startswith(f"{name.partition('[')[0]}[")]
        near = nearest(name, columns)
        return self._error(
            target,
            f"names {name!r}, which the log does not have",
            "rows count from 1, after the time." if rows else "a typing error, or another log.",
            (f"did you mean {near!r}? " if near and not rows else "")
            + f"its columns: {listed(rows or columns, LISTED)}",
        )

    def _error(self, target: str, what: str, cause: str, fix: str) -> Heli3dofError:
        entry = f"{target}={self.entries[target]}"
        if target in self.given:
            return UsageError(f"--map '{entry}' {what}.", cause=cause, fix=fix)
        return RecordingError(f"[log] {entry} of the profile {what}.", cause=cause, fix=fix)


def _unknown(tree: ast.expr) -> list[str]:
    """Return the names in a parsed expression that are no placeholder, function or ``pi``."""
    found: list[str] = []
    functions = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    indexed = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Subscript | ast.Attribute)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript | ast.Attribute) and id(node) not in indexed:
            found.append(ast.unparse(node))
        elif isinstance(node, ast.Name) and id(node) not in functions | indexed:
            found += [] if node.id == "pi" or re.fullmatch(r"_\d+_", node.id) else [node.id]
    return found
