"""Parts of compiled steps are called by compiled steps alone.

Python could call them, too. But each would be compiled in its first call, for a third of a second, in the
middle of a drive.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

PARTS = {"inlined", "in_place"}  # the decorators of parts
ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("controller", "hal", "sim", "vision")


def functions(tree: ast.Module) -> Iterator[tuple[ast.FunctionDef, set[str]]]:
    """All functions of a file, each with the names of its decorators."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            decorators = (one.func if isinstance(one, ast.Call) else one for one in node.decorator_list)
            yield node, {one.id for one in decorators if isinstance(one, ast.Name)}


def parts_in_reach(tree: ast.Module, parts: dict[str, set[str]], module: str) -> set[str]:
    """The names under which a file knows inlined parts: its own, and those that it imports."""
    known = set(parts.get(module, set()))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            inlined = parts.get(node.module, set())
            known |= {name.asname or name.name for name in node.names if name.name in inlined}
    return known


def test_no_inlined_part_is_called_from_python() -> None:
    trees = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): ast.parse(path.read_text())
        for name in PACKAGES
        for path in (ROOT / name).rglob("*.py")
    }
    parts = {
        module: {function.name for function, decorators in functions(tree) if decorators & PARTS}
        for module, tree in trees.items()
    }
    called = []
    for module, tree in trees.items():
        known = parts_in_reach(tree, parts, module)
        called += [
            f"{module}.{function.name} calls {call.func.id}"
            for function, decorators in functions(tree)
            if module.startswith(PACKAGES) and not decorators & {*PARTS, "compiled"}
            for call in ast.walk(function)
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in known
        ]
    assert called == []
