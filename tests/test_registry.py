"""Registries: names are known without importing, and every entry is of its type."""

import subprocess
import sys

import pytest

from brrt.registry import Registry
from brrt.settings import Settings
from brrt.worlds import GENERATORS, LOADERS
from brrt.worlds.generators.generator import Generator
from brrt.worlds.loaders.loader import Loader

LISTING = """
import sys
from brrt.worlds import GENERATORS, LOADERS, World
assert "maze2d" in GENERATORS and "nothing" not in LOADERS
assert len(list(GENERATORS)) == len(GENERATORS) > 20
World.from_json(World("w", [0, 0], [1, 1]).to_json())
heavy = ("brrt.worlds.generators", "brrt.worlds.loaders", "yaml", "PIL", "shapely", "numba")
print([name for name in heavy if name in sys.modules])
"""


def test_listing_names_and_reading_a_world_imports_no_generator() -> None:
    """In a new process."""
    done = subprocess.run(
        [sys.executable, "-c", LISTING], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(("registry", "base"), [(GENERATORS, Generator), (LOADERS, Loader)])
def test_every_entry_exists(registry: Registry[type[Settings]], base: type[Settings]) -> None:
    """Each is a concrete class with a name of its own."""
    classes = list(registry.values())
    assert all(issubclass(each, base) for each in classes)
    assert all(each().describe() is not None for each in classes)
    assert len({each.__name__ for each in classes}) == len(registry)


def test_unknown_names() -> None:
    """A registry is a mapping: unknown names raise KeyError, get returns the default."""
    with pytest.raises(KeyError):
        GENERATORS["nothing"]
    assert GENERATORS.get("nothing") is None
