"""The wheel has every package that the tree has, and no top-level `cli`."""

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
    """`__all__` is the public list: sorted as ruff wants it, and whole."""
    assert all(hasattr(brrt, name) for name in brrt.__all__)
    public = {n for n in vars(brrt) if not n.startswith("_")}
    modules = {n for n in public if type(getattr(brrt, n)).__name__ == "module"}
    assert public - modules == set(brrt.__all__)
