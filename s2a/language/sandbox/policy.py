"""The policy on the text of a script: an allowlist on its syntax tree.

Everything that is not known to be harmless is refused: statements, operators, names, operations
(`s2a.language.sandbox.operations`) and the files they are given. It is the first of three walls, and the one that says which
line is wrong and why.
"""

import ast
import posixpath
import re
from collections.abc import Iterator
from dataclasses import dataclass

from s2a.core.bounds import Count, Positive
from s2a.language.sandbox.constants import WIDTH, Values
from s2a.language.sandbox.operations import (
    BUILTINS,
    DOTTED,
    FILES,
    FORMS,
    GROWING,
    METADATA,
    METHODS,
    MODULES,
    NUMERIC,
    OTHERS,
    PROPERTIES,
    STORES,
    WRAPPING,
    PolicyViolation,
)

LOOPS_IN_LOOPS, NESTING, FUNCTIONS = 3, 60, 20


@dataclass(frozen=True)
class AllowConfig:
    """Bounds on the text of a script."""

    max_length: Count = 20000  # length of the script [characters]. Characters; a script has 1000 to 3000
    max_text: Count = 1000  # length of a string [characters]. Characters
    max_number: Positive = 1000000.0  # magnitude of a number
    max_items: Count = 200  # items of a list
    max_repeats: Count = 200  # iterations of a loop


def refuse_nested(tree: ast.Module) -> None:
    """Refuse nesting that would exhaust a stack, and loops inside each other; the other rules take time where these are."""
    level: list[tuple[ast.AST, int]] = [(tree, 0)]
    for _ in range(NESTING):
        level = [(child, loops + _loop_count(child)) for node, loops in level for child in ast.iter_child_nodes(node)]
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


def _loop_count(node: ast.AST) -> int:
    """Return how many loops a node is; a comprehension has one for each `for`, over what it computes."""
    return len(node.generators) if isinstance(node, ast.ListComp) else int(isinstance(node, ast.For))


def _is_number(node: ast.expr | tuple | None, values: Values, seen: frozenset[str] = frozenset()) -> bool:
    """Return True if an expression is statically known to be a number, or a vector, quaternion or matrix of Gf."""
    constants = values.of(node)
    if constants is not None:
        return all(isinstance(value, (int, float)) for value in constants)
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
    constants = values.of(node)
    if constants is not None:
        return all(
            isinstance(value, (tuple, list, dict, str)) and len(value) <= config.max_repeats for value in constants
        )
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


HIDDEN = re.compile(r"__|(?<![A-Za-z0-9])_(?=[A-Za-z])")  # A text that spells a name which begins with an underscore


@dataclass(frozen=True)
class _Check:
    """What the rules need to know."""

    values: Values  # what the script's expressions can be
    files: dict[str, str]  # which file "stage" and "object" are
    called: frozenset[ast.expr]  # the expressions that are called
    config: AllowConfig  # bounds


def check(text: str, stage: str, reference: str, config: AllowConfig) -> None:
    """Refuse a script that holds anything but harmless operations on the stage and the object it is given.

    Args:
        text: Python.
        stage: file name of the only stage it may open; it may also say `STAGE`.
        reference: path of the only file it may refer to; it may also say `OBJECT`.
        config: bounds.

    Raises:
        PolicyViolation: with the line and the reason.
    """
    tree = _parse(text, config)
    try:
        findings = _findings(tree, stage, reference, config)
    except RecursionError as error:
        raise PolicyViolation("allowlist", "it is too entangled; use fewer names") from error
    except PolicyViolation:
        raise
    except Exception as error:  # of values that nobody expects: what cannot be analysed is not run
        raise PolicyViolation(
            "allowlist", f"it cannot be analysed ({type(error).__name__}); write it plainly"
        ) from error
    if findings:
        line, _, reason = min(findings)
        raise PolicyViolation("allowlist", reason, line)


def _findings(tree: ast.Module, stage: str, reference: str, config: AllowConfig) -> list[tuple[int, int, str]]:
    """Return the line, the rank and the reason of everything that is wrong with a script."""
    refuse_nested(tree)
    values = Values(tree, {"STAGE": stage, "OBJECT": reference})
    refuse_entangled(tree, values)
    called = frozenset(node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    check = _Check(values, {"stage": stage, "object": reference}, called, config)
    rules = (_forms, _imported, _identifiers, _constants, _names, _attributes, _calls, _files, _loops)
    return [
        (line, rank, reason)
        for line, node in _lines(tree)
        for rank, rule in enumerate(rules)
        if (reason := rule(node, check))
    ]


def _lines(tree: ast.Module) -> Iterator[tuple[int, ast.AST]]:
    """Yield every node with its line; operators stand where their expression stands."""
    waiting: list[tuple[int, ast.AST]] = [(1, tree)]
    while waiting:
        line, node = waiting.pop()
        line = getattr(node, "lineno", line)
        yield line, node
        waiting += [(line, child) for child in ast.iter_child_nodes(node)]


def _parse(text: str, config: AllowConfig) -> ast.Module:
    """Return the syntax tree, without the one dunder that every script may have: `if __name__ == "__main__":`."""
    if len(text) > config.max_length:
        raise PolicyViolation("allowlist", f"it is {len(text)} characters long; at most {config.max_length}")
    try:
        tree = ast.parse(text)
        for node in tree.body:
            if isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'":
                node.test = ast.copy_location(ast.Constant(True), node.test)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = error.lineno if isinstance(error, SyntaxError) else None
        raise PolicyViolation("allowlist", f"it is not Python: {str(error)[:100]}", line) from error
    return tree


def _forms(node: ast.AST, check: _Check) -> str | None:
    """Statements and operators."""
    name = type(node).__name__
    if name not in FORMS:
        return f"{name} is not possible in such a script"
    if isinstance(node, ast.FunctionDef) and (check.values.functions.get(node.name) is not node or node.decorator_list):
        return f"function {node.name} is inside another, defined twice, or decorated"
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
        none = any(isinstance(side, ast.Constant) and side.value is None for side in (node.left, node.right))
        return None if none else "BitOr is not possible in such a script, but in annotations such as `Usd.Prim | None`"
    keywords = isinstance(node, ast.keyword) and node.arg is None
    if keywords or isinstance(node, ast.arguments) and (node.vararg or node.kwarg):
        return "arguments with * or ** are not possible; write them out"
    if isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load):
        return "an item of a list cannot be assigned; make a new list"
    return None


def _identifiers(node: ast.AST, check: _Check) -> str | None:
    """Everything that is spelled as a name."""
    for field in ("id", "attr", "arg", "name", "asname"):
        name = getattr(node, field, None)
        if isinstance(name, str) and name != "_" and (name.startswith("_") or "__" in name):
            return f"{name!r} begins with an underscore"
    return None


def _constants(node: ast.AST, check: _Check) -> str | None:
    """Texts, numbers and lists, also those that are put together from others."""
    if isinstance(node, ast.Constant) and not isinstance(node.value, (str, int, float, bool, type(None))):
        return f"a constant of type {type(node.value).__name__} is not possible"
    if (
        isinstance(node, (ast.List, ast.Tuple, ast.Dict))
        and len(list(ast.iter_child_nodes(node))) > check.config.max_items
    ):
        return f"a list of more than {check.config.max_items} items"
    for value in check.values.parts(node):
        if isinstance(value, str) and HIDDEN.search(value):
            return f"the text {value[:60]!r} spells a name that begins with an underscore"
        if isinstance(value, str) and (len(value) > check.config.max_text or "\0" in value):
            return f"a text of {len(value)} characters, or with a zero byte; at most {check.config.max_text}"
        if isinstance(value, (int, float)) and not abs(value) <= check.config.max_number:
            return f"a number beyond {check.config.max_number:g}"
    if isinstance(node, ast.FormattedValue) and node.format_spec:
        specs = check.values.of(node.format_spec)
        if specs is None or any(WIDTH.search(spec) for spec in specs):
            return "a format whose width does not follow from the text, or has three digits"
    if isinstance(node, ast.AugAssign) and not isinstance(node.op, (ast.Add, ast.Sub)):
        return "only += and -= are possible"
    return growth(node, check.values)


def _imported(node: ast.AST, check: _Check) -> str | None:
    """Imports."""
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


def _names(node: ast.AST, check: _Check) -> str | None:
    """Names must be the script's own or known; what is known may not be given another meaning."""
    values = check.values
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
        if node.id in values.functions and node not in check.called:
            return f"{node.id} can only be called"
        if not any(node.id in names for names in (values.names, values.functions, values.modules, BUILTINS)):
            return f"{node.id!r} is neither the script's own name nor among: {', '.join(sorted(BUILTINS))}"
    taken = [*values.modules, *values.functions, *BUILTINS]
    given = None
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        given = node.id
    elif isinstance(node, (ast.arg, ast.ExceptHandler)):
        given = node.arg if isinstance(node, ast.arg) else node.name
    elif isinstance(node, ast.FunctionDef):
        given, taken = node.name, [*values.modules, *values.names, *BUILTINS]
    elif isinstance(node, ast.alias):
        given, taken = node.asname or node.name, [*BUILTINS]
    return f"{given!r} already means something else; choose another name" if given in taken else None


def _attributes(node: ast.AST, check: _Check) -> str | None:
    """What stands behind a dot."""
    if not isinstance(node, ast.Attribute):
        return None
    name = check.values.dotted(node)
    if node not in check.called and (name in FILES or name is None and node.attr in METHODS - PROPERTIES):
        return f"{name or node.attr} can only be called"
    if name is not None:
        # Parts of a longer name are looked at, too: every one of them must be known, or a module.
        possible = name in DOTTED or any(longer.startswith(f"{name}.") for longer in DOTTED)
        return None if possible else f"{name} is not among the operations that place an object"
    if isinstance(node.ctx, ast.Store):
        return None if node.attr in STORES else f"{node.attr!r} may not be assigned"
    return None if node.attr in METHODS else f"{node.attr!r} is not among the operations that place an object"


def _calls(node: ast.AST, check: _Check) -> str | None:
    """What is called must be known by its name, and some arguments are looked at."""
    if not isinstance(node, ast.Call):
        return None
    values = check.values
    name = values.dotted(node.func)
    if isinstance(node.func, ast.Name):
        possible = node.func.id in values.functions or node.func.id in BUILTINS or (name or "").startswith("math.")
        return None if possible else f"{node.func.id!r} is called, but is no function of the script"
    if not isinstance(node.func, ast.Attribute):
        return "what is called has no name"
    if name is not None and name not in DOTTED:
        return f"{name} is not among the operations that place an object"
    if node.func.attr == "format" and values.of(node) is None:
        return "format only with texts that are written out, and without looking into them; use an f-string"
    keys = values.of(node.args[0]) if node.args else None
    if node.func.attr == "SetMetadata" and not all(str(key) in METADATA for key in keys or [None]):
        return f"SetMetadata only of {', '.join(sorted(METADATA))}, written out"
    return None


def _files(node: ast.AST, check: _Check) -> str | None:
    """Files must be the given ones, and it must follow from the text that they are."""
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return None
    name = check.values.dotted(node.func) or node.func.attr
    if name not in FILES:
        return None
    keywords = ("assetPath", "filePath", "identifier", "items")
    given = [*node.args[:1], *(keyword.value for keyword in node.keywords if keyword.arg in keywords)]
    allowed = check.files[FILES[name]]
    if len(given) != 1:
        return f"{name} needs its file as first argument: {allowed!r}"
    for path in check.values.parts(given[0]) or [None]:
        plain = posixpath.normpath(path) if isinstance(path, str) and FILES[name] == "stage" else path
        if plain != allowed:
            what = "a file that does not follow from the text" if path is None else repr(path)[:80]
            return f"{name} is given {what}; only {allowed!r} is possible, written out"
    return None


def _loops(node: ast.AST, check: _Check) -> str | None:
    """Loops must end soon, which must follow from the text."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range":
        if not _bounded(node, check.values, check.config, set()):
            return f"a range that is not known to be below {check.config.max_repeats}"
    elif isinstance(node, (ast.For, ast.comprehension)) and not _bounded(node.iter, check.values, check.config, set()):
        return f"a loop whose number of rounds does not follow from the text, or is above {check.config.max_repeats}"
    return None
