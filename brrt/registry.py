"""Registry: named objects that are imported when they are looked up."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import TypeVar, cast

V_co = TypeVar("V_co", covariant=True)


class Registry(Mapping[str, V_co]):
    """A mapping from names to objects; listing and testing names imports nothing.

    Annotate the variable with the type of the values:

        ROBOTS: Registry[type[Robot]] = Registry({"point": "brrt.robots.point:Point"})

    Args:
        entries: For each name where its object is defined, as `module:attribute`.
    """

    def __init__(self, entries: Mapping[str, str]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> V_co:
        module, _, attribute = self._entries[name].partition(":")
        return cast("V_co", getattr(import_module(module), attribute))

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)
