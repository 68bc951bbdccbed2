"""What the names in a script may stand for, whichever line and scope gives it to them."""

from __future__ import annotations

import ast
import itertools
from collections import defaultdict

from s2a.language.sandbox.operations import MODULES, OTHERS


class Names:
    """The names of a script.

    Attributes:
        functions: the functions that the script defines, by name.
        names: for each other name the expressions that it may stand for: ("each", list) and ("item", list, index) for what
            comes out of one, None for what does not follow from the text.
        modules: what the script calls the modules of pxr, and others that it imports.
    """

    def __init__(self, tree: ast.Module, given: dict[str, str]) -> None:
        """Collect all names.

        Args:
            tree: the script.
            given: names that it finds, with their values.
        """
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


def foreign(node: ast.AST) -> str | None:
    """Return what is wrong with an import; None for what is possible, and for other nodes."""
    possible = f"only `from pxr import ...` with {', '.join(MODULES)}, and math and typing, are"
    if isinstance(node, ast.Import):
        others = [alias.name for alias in node.names if alias.name not in OTHERS]
        return f"Import is not possible of {others[0]}; {possible}" if others else None
    if not isinstance(node, ast.ImportFrom):
        return None
    module = node.module or ""
    names = {"pxr": MODULES, "__future__": ("annotations",), **OTHERS}.get(module, ())
    others = [alias.name for alias in node.names if alias.name not in names]
    if not names or node.level or others:
        given = others[0] if names and others else module or "what is beside the script"
        return f"{given} may not be imported; {possible}"
    return None
