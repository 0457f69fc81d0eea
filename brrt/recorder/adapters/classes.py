"""Call back once a script, or a module that it imports, has defined a class.

Classes of the script itself pass a decorator that is put into its syntax tree, since they are used
in the file that defines them. Those of modules are found in the module once it is imported.
"""

import ast
from collections.abc import Callable
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from brrt.recorder.adapters.imports import when_imported

OnClass = Callable[[type], None]

DECORATOR = "__brrt_class__"
"""Name of the decorator in the script's module."""

_INSTALLED = {"site-packages", "dist-packages"}
_OWN = tuple(str(Path(ast.__file__).parent / name) for name in ("", "lib-dynload"))

_watchers: list[OnClass] = []


def when_defined(call: OnClass) -> Callable[[], None]:
    """Call back for each class that the script and its own modules define from now on.

    Modules of installed packages and of Python itself are left out.

    Args:
        call: Takes the class, right after its definition, or after the import of its module.

    Returns:
        What ends it.
    """

    def imported(module: ModuleType) -> None:
        for each in list(vars(module).values()):
            if isinstance(each, type) and each.__module__ == module.__name__:
                call(each)

    _watchers.append(call)
    unhook = when_imported(_is_of_the_script, imported)

    def end() -> None:
        _watchers.remove(call)
        unhook()

    return end


def _is_of_the_script(spec: ModuleSpec) -> bool:
    origin = Path(spec.origin or "")
    installed = not _INSTALLED.isdisjoint(origin.parts) or str(origin.parent).startswith(_OWN[0])
    return isinstance(spec.loader, SourceFileLoader) and not installed


def announced(made: Any) -> Any:
    """Tell of a class, and return it; a decorator."""
    if isinstance(made, type):
        for call in _watchers:
            call(made)
    return made


class _Decorated(ast.NodeTransformer):
    """Puts the decorator before those of each class, so that it gets what they return."""

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        self.generic_visit(node)
        first = node.decorator_list[0] if node.decorator_list else node
        name = ast.copy_location(ast.Name(DECORATOR, ast.Load()), first)
        node.decorator_list.insert(0, name)
        return node


def compile_script(source: bytes | str, file: str) -> CodeType:
    """Compile a script whose classes are announced; the names of its lines stay.

    Raises:
        SyntaxError: It is no Python.
        ValueError: It holds a null byte.
    """
    parsed = compile(source, file, "exec", ast.PyCF_ONLY_AST, dont_inherit=True)
    tree = _Decorated().visit(parsed)
    code: CodeType = compile(tree, file, "exec", dont_inherit=True)
    return code
