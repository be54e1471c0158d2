"""Formulas as text: a small language, read by a whitelist and never evaluated as code.

Numbers, the names that are allowed, ``pi``, ``+ - * / **``, parentheses and the functions of
`FUNCTIONS`. A formula works on numbers, arrays and intervals, and compiles with Numba.
"""

from __future__ import annotations

import ast
import keyword
import math
import operator
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from types import FunctionType
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smolux.errors import InputError, did_you_mean

from .intervals import Interval

#: function -> (its NumPy name, number of arguments; None: two or more)
FUNCTIONS: dict[str, tuple[str, int | None]] = {
    "sqrt": ("sqrt", 1),
    "cbrt": ("cbrt", 1),
    "exp": ("exp", 1),
    "log": ("log", 1),
    "abs": ("abs", 1),
    "sin": ("sin", 1),
    "cos": ("cos", 1),
    "tanh": ("tanh", 1),
    "min": ("minimum", None),
    "max": ("maximum", None),
}
CONSTANTS = {"pi": math.pi}

_LONGEST = 1000
_DEEPEST = 60
#: whole exponents up to this are kept whole, so that compiled code multiplies
_LARGEST_POWER = 64
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_NUMPY = "_np"  # no name of the language begins with an underscore


@dataclass(frozen=True)
class Formula:
    """A formula in given names; made by `parse`.

    Attributes
    ----------
    text : str
        As it was written.
    names : tuple of str
        The names that occur in it, in the order in which they were allowed.
    """

    text: str
    names: tuple[str, ...]

    def function(self, arguments: Sequence[str]) -> Callable[..., Any]:
        """Return a plain function of positional numbers, arrays or intervals.

        Parameters
        ----------
        arguments : sequence of str
            Its arguments; every name of the formula must be among them.

        Returns
        -------
        callable
            The same object for the same text and arguments. Numba compiles it.
        """
        return _function(self.text, tuple(arguments))

    def evaluate(self, **values: ArrayLike) -> NDArray[np.float64]:
        """Evaluate on numbers or arrays, given by name and broadcast against each other.

        What is undefined is NaN, what overflows is infinite.
        """
        arrays = {key: np.asarray(value, float) for key, value in values.items()}
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
        with np.errstate(all="ignore"):
            result = _function(self.text, tuple(arrays))(*arrays.values())
        return np.broadcast_to(np.asarray(result, float), shape).copy()

    def interval(self, **values: Interval) -> Interval:
        """Bounds of the formula over intervals, given by name; see `smolux.functions.intervals`."""
        result = _function(self.text, tuple(values))(*values.values())
        return result if isinstance(result, Interval) else Interval(float(result))


def parse(text: str, names: Sequence[str], what: str = "formula") -> Formula:
    """Read a formula.

    Parameters
    ----------
    text : str
        For example ``"(i/j)**a + (j/i)**a"``.
    names : sequence of str
        The names that may occur.
    what : str
        What it stands for, for messages.

    Returns
    -------
    Formula

    Raises
    ------
    InputError
        Naming the column and the cure: not a formula, an unknown name or function, too long.
    """
    used = _Reader(text, tuple(names), what).read()[1]
    return Formula(text, tuple(name for name in names if name in used))


def check_names(names: Sequence[str], taken: Sequence[str], what: str) -> list[str]:
    """Return what is wrong with the names of parameters.

    Parameters
    ----------
    names : sequence of str
    taken : sequence of str
        Names with a meaning already, such as ``i`` and ``j``.
    what : str
        For messages.
    """
    problems = []
    for name in names:
        where = f"{what}: parameter {name!r}"
        if not name.isidentifier() or keyword.iskeyword(name) or name.startswith("_"):
            problems.append(f"{where}: a name has letters and digits and begins with a letter")
        elif name in FUNCTIONS or name in CONSTANTS or name in taken:
            problems.append(f"{where}: has a meaning already; choose another name")
    return problems


class _Reader:
    """Turns the text into a checked expression tree; refuses whatever is not on the list."""

    def __init__(self, text: str, names: tuple[str, ...], what: str) -> None:
        self.names = names
        self.what = what
        self.used: set[str] = set()
        if not isinstance(text, str):
            raise InputError(f"{what} = {text!r}: must be text such as '(i + j)**2'")
        self.text = " ".join(text.splitlines())
        self.indent = len(self.text) - len(self.text.lstrip())

    def read(self) -> tuple[ast.expr, set[str]]:
        if not self.text.strip():
            raise InputError(f"{self.what}: is empty; write for example '(i + j)**2'")
        if len(self.text) > _LONGEST:
            raise InputError(
                f"{self.what}: has {len(self.text)} characters, at most {_LONGEST} are read; "
                "write a Python function instead"
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                tree = ast.parse(self.text.strip(), mode="eval")
        except SyntaxError as error:
            raise self._syntax(error) from None
        except (ValueError, RecursionError, MemoryError):
            raise InputError(f"{self.what} = {self.text!r}: cannot be read") from None
        return self._node(tree.body, 0), self.used

    def _syntax(self, error: SyntaxError) -> InputError:
        end = len(self.text.rstrip()) + 1
        column = min(error.offset + self.indent, end) if error.offset else end
        cure = "check the parentheses and operators"
        if re.search(r"[0-9)]\s*[A-Za-z(]", self.text):
            cure += "; products need a *, as in 2*i"
        words = re.findall(r"[A-Za-z]+", self.text)
        reserved = [word for word in words if keyword.iskeyword(word)]
        if reserved:
            cure = f"{reserved[0]!r} is a reserved word and cannot be used here"
        return InputError(f"{self.what} = {self.text!r}: not understood at column {column}: {cure}")

    def _fail(self, node: ast.AST, message: str) -> NoReturn:
        line = self.text.strip().encode()  # columns of the tree count bytes
        column = len(line[: node.col_offset].decode(errors="replace")) + 1  # type: ignore[attr-defined]
        raise InputError(
            f"{self.what} = {self.text!r}: column {column + self.indent}: {message}"
        ) from None

    def _node(self, node: ast.expr, depth: int) -> ast.expr:
        if depth > _DEEPEST:
            self._fail(
                node, f"nested deeper than {_DEEPEST} levels; write a Python function instead"
            )
        match node:
            case ast.Constant():
                return ast.Constant(self._number(node))
            case ast.Name():
                return self._name(node)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
                return self._folded(node, self._node(node.operand, depth + 1))
            case ast.BinOp() if type(node.op) in _OPERATORS:
                left = self._node(node.left, depth + 1)
                return self._folded(node, left, self._node(node.right, depth + 1))
            case ast.Call(func=ast.Name(id=name)) if not node.keywords:
                return self._call(node, name, depth)
        self._fail(node, self._refusal(node))

    def _refusal(self, node: ast.expr) -> str:
        match node:
            case ast.BinOp(op=ast.BitXor()):
                return "write ** for a power, not ^"
            case ast.BinOp(op=ast.FloorDiv() | ast.Mod()):
                return "only + - * / ** are known"
            case ast.Compare() | ast.IfExp() | ast.BoolOp():
                return (
                    "comparisons are not part of formulas; use min, max, abs, or a Python function"
                )
            case ast.Call():
                return "only " + ", ".join(FUNCTIONS) + " can be called, with plain arguments"
            case ast.Tuple():
                return "a comma has no place here; the decimal sign is a point"
        return "only numbers, names, + - * / **, parentheses and functions are known"

    def _number(self, node: ast.Constant) -> float:
        if type(node.value) not in (int, float):
            self._fail(node, f"{node.value!r} is not a real number")
        try:
            value = float(node.value)  # type: ignore[arg-type]
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            self._fail(node, "this number is too large")
        return value

    def _folded(self, node: ast.UnaryOp | ast.BinOp, *parts: ast.expr) -> ast.expr:
        """Compute what consists of numbers only; keep small whole exponents whole."""
        apply = _OPERATORS[type(node.op)]
        numbers = [part.value for part in parts if isinstance(part, ast.Constant)]
        if len(numbers) == len(parts):
            return self._constant(node, apply, numbers)
        if len(parts) == 1:
            return ast.UnaryOp(node.op, parts[0])  # type: ignore[arg-type]
        left, right = parts
        if isinstance(node.op, ast.Pow) and isinstance(right, ast.Constant):
            power = float(right.value)  # type: ignore[arg-type]
            if power.is_integer() and abs(power) <= _LARGEST_POWER:
                right = ast.Constant(int(power))
        return ast.BinOp(left, node.op, right)  # type: ignore[arg-type]

    def _constant(self, node: ast.expr, function: Any, numbers: list[Any]) -> ast.Constant:
        with np.errstate(all="ignore"):
            value = float(function(*(np.float64(number) for number in numbers)))
        if not math.isfinite(value):
            self._fail(node, f"this is {value}, not a finite number")
        return ast.Constant(value)

    def _name(self, node: ast.Name) -> ast.expr:
        if node.id in CONSTANTS:
            return ast.Constant(CONSTANTS[node.id])
        if node.id in self.names:
            self.used.add(node.id)
            return ast.Name(node.id, ast.Load())
        if node.id in FUNCTIONS:
            self._fail(node, f"the function {node.id!r} needs arguments, as in {node.id}(i)")
        known = [*self.names, *CONSTANTS, *FUNCTIONS]
        self._fail(node, f"unknown name {node.id!r}{did_you_mean(node.id, known)}")

    def _call(self, node: ast.Call, name: str, depth: int) -> ast.expr:
        if name not in FUNCTIONS:
            if name in self.names or name in CONSTANTS:
                self._fail(node, f"{name!r} is not a function; products need a *")
            self._fail(node, f"unknown function {name!r}{did_you_mean(name, list(FUNCTIONS))}")
        numpy_name, count = FUNCTIONS[name]
        if len(node.args) != count if count else len(node.args) < 2:
            wanted = f"{count} argument" if count else "two arguments or more"
            self._fail(node, f"{name} takes {wanted}, not {len(node.args)}")
        function = ast.Attribute(ast.Name(_NUMPY, ast.Load()), numpy_name, ast.Load())
        result, *rest = (self._node(argument, depth + 1) for argument in node.args)
        if all(isinstance(part, ast.Constant) for part in (result, *rest)):
            values = [part.value for part in (result, *rest)]  # type: ignore[attr-defined]
            return self._constant(node, _reduced(getattr(np, numpy_name)), values)
        if count:
            return ast.Call(function, [result], [])
        for argument in rest:
            result = ast.Call(function, [result, argument], [])
        return result


def _reduced(function: Any) -> Callable[..., Any]:
    return lambda *values: function(*values) if len(values) == 1 else reduce(function, values)


@lru_cache(maxsize=1024)
def _function(text: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    """Build the function from the checked tree; nothing of the text itself is run."""
    body, _ = _Reader(text, arguments, "formula").read()
    signature = ast.arguments([], [ast.arg(name) for name in arguments], None, [], [], None, [])
    tree = ast.fix_missing_locations(ast.Expression(ast.Lambda(signature, body)))
    code = compile(tree, "<formula>", "eval").co_consts[0]
    return FunctionType(code, {_NUMPY: np, "__builtins__": {}}, "formula")
