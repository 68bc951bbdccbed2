"""Static bounds on the time and the memory of a script.

What cannot be bounded statically is left to the limits of the process.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass

from s2a.core.bounds import Count, Positive
from s2a.language.sandbox.constants import Values
from s2a.language.sandbox.operations import GROWING, NUMERIC, WRAPPING, PolicyViolation

LOOPS_IN_LOOPS, NESTING, FUNCTIONS = 3, 60, 20


@dataclass(frozen=True)
class AllowConfig:
    """Bounds on the text of a script.

    Attributes:
        max_length: length of the script [characters].
        max_text: length of a string [characters].
        max_number: magnitude of a number.
        max_items: items of a list.
        max_repeats: iterations of a loop.
    """

    max_length: Count
    max_text: Count
    max_number: Positive
    max_items: Count
    max_repeats: Count


def refuse_nested(tree: ast.Module) -> None:
    """Refuse nesting that would exhaust a stack, and loops inside each other; the other rules take time where these are."""
    level: list[tuple[ast.AST, int]] = [(tree, 0)]
    for _ in range(NESTING):
        level = [(child, loops + _loops(child)) for node, loops in level for child in ast.iter_child_nodes(node)]
        if deep := [node for node, loops in level if loops > LOOPS_IN_LOOPS]:
            raise PolicyViolation(
                "allowlist", f"more than {LOOPS_IN_LOOPS} loops inside each other", getattr(deep[0], "lineno", None)
            )
    if level:
        raise PolicyViolation(
            "allowlist", "it is nested too deeply; use shorter expressions", getattr(level[0][0], "lineno", None)
        )


def refuse_entangled(tree: ast.Module, values: Values) -> None:
    """Refuse functions that may call themselves."""
    if len(values.functions) > FUNCTIONS:
        raise PolicyViolation("allowlist", f"it has {len(values.functions)} functions; at most {FUNCTIONS}")
    for function in values.functions.values():
        for node in ast.walk(function):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                continue
            callee = node.func.id
            if callee in values.functions and values.functions[callee].lineno >= function.lineno:
                raise PolicyViolation(
                    "allowlist", f"{callee} is called before it is defined, or by itself", node.lineno
                )


def growth(node: ast.AST, values: Values) -> str | None:
    """Products of texts or lists, and formats with a width."""
    if not isinstance(node, ast.BinOp) or not isinstance(node.op, (ast.Mult, ast.Mod)):
        return None
    for side in (node.left, node.right):
        if isinstance(node.op, ast.Mult) and not _is_number(side, values):
            return "only numbers may be multiplied"
    if isinstance(node.op, ast.Mod) and values.of(node) is None and not _is_number(node.left, values):
        return "% only with texts and numbers that are written out; use an f-string"
    return None


def repetition(node: ast.AST, values: Values, config: AllowConfig) -> str | None:
    """Loops must end soon, which must follow from the text."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range":
        return (
            None
            if _bounded(node, values, config, set())
            else f"a range that is not known to be below {config.max_repeats}"
        )
    if not isinstance(node, (ast.For, ast.comprehension)):
        return None
    if not _bounded(node.iter, values, config, set()):
        return f"a loop whose number of rounds does not follow from the text, or is above {config.max_repeats}"
    return None


def _loops(node: ast.AST) -> int:
    """Return how many loops a node is; a comprehension has one for each `for`, over what it computes."""
    return len(node.generators) if isinstance(node, ast.ListComp) else int(isinstance(node, ast.For))


def _is_number(node: ast.expr | tuple | None, values: Values, seen: frozenset[str] = frozenset()) -> bool:
    """Return True if an expression is statically known to be a number, or a vector, quaternion or matrix of Gf."""
    known = values.of(node)
    if known is not None:
        return all(isinstance(value, (int, float)) for value in known)
    match node:
        case ast.BinOp():
            return _is_number(node.left, values, seen) and _is_number(node.right, values, seen)
        case ast.IfExp():
            return _is_number(node.body, values, seen) and _is_number(node.orelse, values, seen)
        case ast.UnaryOp():
            return _is_number(node.operand, values, seen)
        case ast.Subscript() | ("item" | "each", _) | ("item", _, _):
            return _is_number(node.value if isinstance(node, ast.Subscript) else node[1], values, seen)
        case ast.Attribute(attr="real" | "imaginary"):
            return True
        case ast.Call():
            return _gives_number(node, values, seen)
        case ast.Name(id=name) if name not in seen:
            return all(_is_number(n, values, seen | {name}) for n in values.names.get(name) or [None])
    return False


def _gives_number(call: ast.Call, values: Values, seen: frozenset[str]) -> bool:
    """Return True for a call that is statically known to give a number, or something of Gf."""
    name = values.dotted(call.func)
    if name is not None:
        return name.startswith(("Gf.", "math.")) or name == "UsdGeom.GetStageMetersPerUnit"
    match call.func:
        case ast.Attribute(attr=method):
            return method in NUMERIC
        case ast.Name(id="sum"):
            return len(call.args) == 1 and not call.keywords  # else its start may be a list
        case ast.Name(id=function) if function in values.functions and function not in seen:
            ends = [node.value for node in ast.walk(values.functions[function]) if isinstance(node, ast.Return)]
            return bool(ends) and all(_is_number(end, values, seen | {function}) for end in ends)
        case ast.Name(id=function):
            return function in ("float", "int", "len", "abs", "round")
    return False


def _bounded(node: ast.expr | tuple | None, values: Values, config: AllowConfig, seen: set[str]) -> bool:
    """Return True for a short iterable: a literal, a range, a list of the stage, or a zip of these."""
    known = values.of(node)
    if known is not None:
        return all(isinstance(value, (tuple, list, dict, str)) and len(value) <= config.max_repeats for value in known)
    match node:
        case ast.List() | ast.Tuple() | ast.Dict():
            return not any(isinstance(item, ast.Starred) for item in ast.iter_child_nodes(node))
        case ast.Call(func=ast.Name(id="range")):
            ends = [values.of(argument) for argument in node.args]
            return all(end is not None and all(_short(e, config) for e in end) for end in ends) and not node.keywords
        case ast.Call(func=ast.Name(id=name), args=arguments) if name in WRAPPING and arguments:
            sources = arguments if name == "zip" else arguments[:1]
            return all(_bounded(source, values, config, seen) for source in sources)
        case ast.Call(func=ast.Attribute(attr=name) as function):
            return values.dotted(function) is None and name in GROWING
        case ast.Name(id=name) if name not in seen:
            nodes = values.names.get(name) or [None]
            return all(_bounded(inner, values, config, {*seen, name}) for inner in nodes)
    return False


def _short(end: object, config: AllowConfig) -> bool:
    return isinstance(end, int) and abs(end) <= config.max_repeats // 2
