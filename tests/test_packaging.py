"""The wheel has every package that the tree has, and no top-level `cli`."""

import re
import tomllib
from pathlib import Path

import brrt

ROOT = Path(__file__).parents[1]


def test_every_package_is_listed() -> None:
    """The list must be explicit since `cli` is renamed; an editable install hides a gap."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    listed = set(project["tool"]["setuptools"]["packages"])
    found = {
        ".".join(("brrt_cli", *rest) if top == "cli" else (top, *rest))
        for top in ("brrt", "cli")
        for init in (ROOT / top).rglob("__init__.py")
        for _, *rest in [init.parent.relative_to(ROOT).parts]
    }
    assert listed == found
    assert "cli" not in listed


def test_public_names_exist() -> None:
    """Each public name is imported from where the stub for type checkers says."""
    stub = (ROOT / "brrt" / "__init__.pyi").read_text()
    listed = dict(brrt._MODULES)  # type: ignore[attr-defined]
    said = re.findall(r"from brrt\.([\w.]+) import (\w+) as (\w+)\n", stub)
    assert {name: module for module, name, _ in said} == listed
    assert all(name == renamed for _, name, renamed in said)
    assert all(hasattr(brrt, name) for name in listed)


def test_headers_are_package_data() -> None:
    """The wheel has the C++ headers and the CMake package, which states the version."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    patterns = project["tool"]["setuptools"]["package-data"]["brrt"]
    folder = ROOT / "brrt"
    shipped = {path for pattern in patterns for path in folder.glob(pattern)}
    for name in ("include", "cmake"):
        files = {path for path in (folder / name).rglob("*") if path.is_file()}
        assert files
        assert files <= shipped
    version = (folder / "cmake" / "brrtConfigVersion.cmake").read_text()
    assert f'set(PACKAGE_VERSION "{project["project"]["version"]}")' in version
