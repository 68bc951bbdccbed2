"""Constant folding: the values that the expressions of a script can have, where they follow from its text.

The order of statements and the scopes of names are not looked at: a name may be whatever any line gives it.
"""

import ast
import itertools
import math
import re
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from s2a.language.sandbox.operations import PolicyViolation


class Names:
    """The names of a script.

    Attributes:
        functions: the functions that the script defines, by name.
        names: for each other name the expressions that it may stand for: ("each", list) and ("item", list, index) for what
            comes out of one, None for what does not follow from the text.
        modules: what the script calls the modules of pxr, and others that it imports.
    """

    def __init__(self, tree: ast.Module, given: dict[str, str]) -> None:
        self.functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
        self.names: dict[str, list[ast.expr | tuple | None]] = defaultdict(list)
        self.modules: dict[str, str] = {}
        for name, text in given.items():
            self.names[name].append(ast.Constant(text))
        for node in ast.walk(tree):
            self._collect(node)

    def _collect(self, node: ast.AST) -> None:
        """Note what a statement gives names to."""
        match node:
            case ast.Import() | ast.ImportFrom():
                self._import(node)
            case ast.Assign():
                for target in node.targets:
                    self._bind(target, node.value)
            case ast.AnnAssign():
                self._bind(node.target, node.value)
            case ast.For() | ast.comprehension():
                self._bind(node.target, ("each", node.iter))
            case ast.AugAssign():
                self._bind(node.target, None)
            case ast.withitem(optional_vars=ast.expr() as target):
                self._bind(target, None)
            case ast.ExceptHandler(name=str() as name):
                self.names[name].append(None)
            case ast.FunctionDef():
                self._bind_parameters(node)
            case ast.Call(func=ast.Name(id=name)) if name in self.functions:
                self._bind_arguments(node, self.functions[name])

    def _import(self, node: ast.Import | ast.ImportFrom) -> None:
        """Note modules, and what is imported from math or typing by its full name."""
        module = node.module if isinstance(node, ast.ImportFrom) else None
        for alias in node.names:
            name, full = alias.asname or alias.name, alias.name if module in (None, "pxr") else f"{module}.{alias.name}"
            # Of two meanings of a name, neither is kept: it is known to no operation.
            self.modules[name] = full if self.modules.get(name, full) == full else "?"

    def _bind(self, target: ast.expr, value: ast.expr | tuple | None) -> None:
        match target:
            case ast.Name():
                self.names[target.id].append(value)
            case ast.Starred():
                self._bind(target.value, None)
            case ast.Tuple() | ast.List():
                starred = False  # what follows a starred name has another place in the list than among the names
                for index, inner in enumerate(target.elts):
                    starred |= isinstance(inner, ast.Starred)
                    self._bind(inner, None if value is None or starred else ("item", value, index))

    def _bind_parameters(self, function: ast.FunctionDef) -> None:
        """Note parameters with their default values; further ones come with the calls."""
        every = function.args
        for parameter in (*every.posonlyargs, *every.args, *every.kwonlyargs):
            self.names[parameter.arg].extend([])
        positional = (*every.posonlyargs, *every.args)
        for parameter, value in zip(reversed(positional), reversed(every.defaults), strict=False):
            self.names[parameter.arg].append(value)
        for parameter, default in zip(every.kwonlyargs, every.kw_defaults, strict=True):
            if default is not None:
                self.names[parameter.arg].append(default)

    def _bind_arguments(self, call: ast.Call, function: ast.FunctionDef) -> None:
        """Note what a call gives to the parameters of a function."""
        parameters = (*function.args.posonlyargs, *function.args.args)
        starred = any(isinstance(argument, ast.Starred) for argument in call.args)
        for parameter, argument in itertools.zip_longest(parameters, () if starred else call.args):
            if parameter is not None and (argument is not None or starred):
                self.names[parameter.arg].append(None if starred else argument)
        for keyword in call.keywords:
            if keyword.arg is not None:
                self.names[keyword.arg].append(keyword.value)


Known = list[Any] | None  # All values that an expression can have; None where they do not follow from the text
WIDTH = re.compile(r"\d{3}")  # A number of three digits in a format: what it gives may be long
# Values of an expression, steps in which those of all are found, and letters and bits of one
MOST_VALUES, MOST_STEPS, MOST_LETTERS, MOST_BITS = 64, 20_000, 2000, 1024
STEP = 100  # Letters that take as long as a step
# What has a path, but is no text: its `str` may be another
PATHS = ("Sdf.Layer.FindOrOpen", "Sdf.Reference", "Sdf.Path")


@dataclass(frozen=True)
class Path:
    """Something that has a path: a layer, a reference, or a path of USD's own."""

    text: str


class Values(Names):
    """The values of a script's expressions."""

    def __init__(self, tree: ast.Module, given: dict[str, str]) -> None:
        super().__init__(tree, given)
        self._steps = 0
        self._active: set[str] = set()
        # A list that has been extended, perhaps under another name, is no longer constant.
        self._mutable = any(
            isinstance(node, ast.AugAssign) or isinstance(node, ast.Attribute) and node.attr in ("append", "extend")
            for node in ast.walk(tree)
        )

    def of(self, node: ast.expr | tuple | None) -> Known:
        """Return all values that an expression can have, or None.

        Raises:
            PolicyViolation: the script is too entangled to tell in reasonable time.
        """
        self._spend(1)
        values = self._of(node)
        return None if values is None or len(values) > MOST_VALUES else values

    def _spend(self, steps: int) -> None:
        self._steps += steps
        if self._steps > MOST_STEPS:
            raise PolicyViolation("allowlist", "its texts are too entangled; write them out")

    def dotted(self, node: ast.expr) -> str | None:
        """Return the name of something below a module of pxr, such as "Usd.Stage.Open"; None for anything else."""
        parts: list[str] = []
        while isinstance(node, ast.Attribute):
            parts.append(node.attr)
            node = node.value
        if not isinstance(node, ast.Name) or node.id not in self.modules:
            return None
        return ".".join([self.modules[node.id], *reversed(parts)])

    def parts(self, node: ast.AST) -> list[object]:
        """Return all values that an expression is known to have, those within a list one by one, and paths as texts."""
        values = self.of(node) if isinstance(node, ast.expr) else None
        parts: list[object] = []
        for value in values or ():
            inner = [*value.keys(), *value.values()] if isinstance(value, dict) else value
            parts += inner if isinstance(inner, (list, tuple)) else [inner]
        return [part.text if isinstance(part, Path) else part for part in parts]

    def _of(self, node: ast.expr | tuple | None) -> Known:
        match node:
            case ast.Constant():
                return None if _huge(node.value) else [node.value]
            case ast.Name():
                return self._of_name(node.id)
            case ast.Tuple():
                return self._combine(node.elts, lambda *items: items, paths=True)
            case ast.List():
                return None if self._mutable else self._combine(node.elts, lambda *items: [*items], paths=True)
            case ast.Dict():
                pairs = [item for pair in zip(node.keys, node.values, strict=True) for item in pair]
                return self._combine(pairs, lambda *items: dict(zip(items[::2], items[1::2], strict=True)), paths=True)
            case ast.Subscript():
                return self._combine([node.value, node.slice], lambda whole, key: whole[key], paths=True)
            case ("item", value, index):
                return self._combine([value], lambda whole: list(whole)[index], paths=True)
            case ("each", value):
                wholes = self._combine([value], tuple, paths=True)
                return None if wholes is None else [item for whole in wholes for item in whole]
            case ast.IfExp():
                return self._union([node.body, node.orelse])
            case ast.BoolOp():
                return self._union(node.values)
            case ast.UnaryOp(op=ast.USub()):
                return self._combine([node.operand], lambda value: -value)
            case ast.BinOp():
                return self._of_sum(node)
            case ast.JoinedStr():
                return self._combine(node.values, lambda *parts: "".join(map(str, parts)))
            case ast.FormattedValue(conversion=-1):
                spec = [node.format_spec] if node.format_spec else []
                return self._combine([node.value, *spec], lambda value, form="": _formatted(value, form))
            case ast.Call():
                return self._of_call(node)
        return None

    def _of_name(self, name: str) -> Known:
        if name in self._active:
            return None
        self._active.add(name)
        try:
            return self._union(self.names[name]) if name in self.names and name not in self.functions else None
        finally:
            self._active.discard(name)

    def _of_sum(self, node: ast.BinOp) -> Known:
        match node.op:
            case ast.Add():
                return self._combine([node.left, node.right], lambda a, b: a + b)
            case ast.Mod():
                return self._combine([node.left, node.right], lambda a, b: a % b if not _wide(a) else None)
            case ast.Mult() | ast.Sub() | ast.Div():
                return self._combine([node.left, node.right], lambda a, b: _number(node.op, a, b))
        return None

    def _of_call(self, node: ast.Call) -> Known:
        """Return the values of calls that give a text, a range or a path."""
        if self.dotted(node.func) in PATHS:
            named = [
                keyword.value for keyword in node.keywords if keyword.arg in ("assetPath", "identifier", "layerPath")
            ]
            return self._combine([*node.args, *named][:1], Path) if node.args or named else None
        match node.func:
            case ast.Name(id="range") if not node.keywords:
                return self._combine(node.args, lambda *ends: tuple(range(*ends)) if _few(range(*ends)) else None)
            case ast.Name(id="str") if len(node.args) == 1:
                return self._combine(node.args, str)
            case ast.Attribute(attr="format"):
                names = [keyword.arg or "" for keyword in node.keywords]
                inner = [node.func.value, *node.args, *(keyword.value for keyword in node.keywords)]
                count = 1 + len(node.args)
                return self._combine(
                    inner,
                    lambda text, *v: (
                        None
                        if _wide(text)
                        else text.format(*v[: count - 1], **dict(zip(names, v[count - 1 :], strict=True)))
                    ),
                )
            case ast.Attribute(attr="join" | "lower" | "upper" | "strip" | "replace" | "title") if not node.keywords:
                method = node.func.attr
                return self._combine([node.func.value, *node.args], lambda text, *v: getattr(str, method)(text, *v))
        return None

    def _union(self, nodes: list) -> Known:
        """Return the values of any of some expressions."""
        union: list[Any] = []
        for node in nodes:
            values = self.of(node)
            if values is None:
                return None
            union += values
        return _distinct(union) or None

    def _combine(self, nodes: list, join: Callable[..., Any], paths: bool = False) -> Known:
        """Return what `join` makes of every combination of values of some expressions; None where it fails, as it would there.

        Args:
            nodes: the expressions.
            join: called with a value of each; None if what it gives is not known.
            paths: Combine what has a path, too: it is passed on as it is.
        """
        every = []
        for node in nodes:
            values = self.of(node)
            if values is None or not paths and any("Path(text=" in repr(value) for value in values):
                return None
            every.append(values)
        if math.prod(map(len, every)) > MOST_VALUES:
            return None
        results: list[Any] = []
        for combination in itertools.product(*every):
            try:
                value = join(*combination)
                letters = MOST_LETTERS + 1 if _huge(value) else len(repr(value))
            except Exception:  # the script would fail there, too: nothing is known
                return None
            self._spend(letters // STEP)
            if value is None or letters > MOST_LETTERS:
                return None
            results.append(value)
        return _distinct(results)


def _distinct(values: list[Any]) -> list[Any]:
    """Return values without repetitions; 1, 1.0 and True are three, and 0.0 is not -0.0."""
    return list({(type(value), repr(value)): value for value in values}.values())


def _huge(value: Any) -> bool:
    """Return True for a number whose digits take long to write."""
    return isinstance(value, int) and value.bit_length() > MOST_BITS


def _formatted(value: Any, form: str) -> str | None:
    return None if WIDTH.search(form) else format(value, form)


def _few(numbers: range) -> bool:
    return len(numbers) <= MOST_VALUES


def _wide(text: Any) -> bool:
    """Return True for a format that may give a long text, or access attributes or items."""
    return isinstance(text, str) and bool(WIDTH.search(text) or re.search(r"\*|\{[^}]*[.\[{]", text))


def _number(operator: ast.operator, a: Any, b: Any) -> float | int | None:
    """Calculate with numbers only: other products grow without bounds."""
    if not isinstance(a, (int, float)) or not isinstance(b, (int, float)):
        return None
    return a * b if isinstance(operator, ast.Mult) else a - b if isinstance(operator, ast.Sub) else a / b
