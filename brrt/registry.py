"""Registries: brrt's own objects by name, and those that other packages add by entry points.

Nothing is imported before it is looked up. Installed packages are asked only for names that brrt
does not have, and for lists of all; no file and no user can name a module, only an entry point.
"""

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar, cast
from warnings import warn

from brrt.errors import BrrtError

V_co = TypeVar("V_co", covariant=True)


class PluginWarning(UserWarning):
    """A plug-in is left out: it cannot be imported, or is not what its entry point promises."""


def _warn(message: str) -> None:
    warn(message, PluginWarning, stacklevel=2)


_report: Callable[[str], None] = _warn
_reported: set[str] = set()


def on_broken(report: Callable[[str], None]) -> None:
    """Set what reports a broken plug-in, once and in one line; by default a warning does."""
    global _report  # noqa: PLW0603 - one command line for a process
    _report = report


def report_broken(message: str) -> None:
    """Report a broken plug-in, unless that was done before."""
    if message not in _reported:
        _reported.add(message)
        _report(message)


class Registry(Mapping[str, V_co]):
    """A mapping from names to objects; listing and testing names imports nothing.

    Annotate the variable with the type of the values:

        ROBOTS: Registry[type[Robot]] = Registry({"point": "brrt.robots.point:Point"})

    Args:
        entries: For each name of brrt's own where its object is defined, as `module:attribute`.
        group: The group of entry points by which other packages add to it; empty if they cannot.
        base: What objects of other packages must be: subclasses of a class, as `module:attribute`.
        label: Attribute of these objects that must be their name in the group, if there is one.
    """

    def __init__(
        self, entries: Mapping[str, str], group: str = "", base: str = "", label: str = ""
    ) -> None:
        self._entries, self._group, self._base, self._label = dict(entries), group, base, label
        self._plugins: dict[str, EntryPoint] | None = None
        self._loaded: dict[str, Any] = {}

    @property
    def own(self) -> Mapping[str, V_co]:
        """The objects of brrt alone; never asks for packages."""
        return Registry(self._entries)

    def __getitem__(self, name: str) -> V_co:
        """Return an object.

        Raises:
            KeyError: There is none of this name.
            BrrtError: It is a plug-in's, and broken.
        """
        if name in self._entries:
            return cast("V_co", _imported(self._entries[name]))
        if name not in self._loaded:
            self._loaded[name] = self._load(name, self._others()[name])
        return cast("V_co", self._loaded[name])

    def __contains__(self, name: object) -> bool:
        return name in self._entries or name in self._others()

    def __iter__(self) -> Iterator[str]:
        yield from self._entries
        yield from self._others()

    def __len__(self) -> int:
        return len(self._entries) + len(self._others())

    def working(self) -> dict[str, V_co]:
        """Return the objects that can be imported, brrt's own first; broken ones are reported."""
        return {name: self[name] for name in self._entries} | self.plugins()

    def plugins(self) -> dict[str, V_co]:
        """Return the objects of other packages that can be imported; broken ones are reported."""
        found: dict[str, V_co] = {}
        for name in self._others():
            try:
                found[name] = self[name]
            except BrrtError as error:
                report_broken(str(error))
        return found

    def package(self, name: str) -> str:
        """Return the package that an object is from, and its version: "brrt-cranes 1.2"."""
        return "brrt" if name in self._entries else _package(self._others()[name])

    def has_imported(self, kind: object) -> bool:
        """Whether an object is brrt's own, or a plug-in's that was looked up."""
        own = (_imported(entry) for entry in self._entries.values())
        return any(kind is each for each in (*own, *self._loaded.values()))

    def _others(self) -> dict[str, EntryPoint]:
        """Return the entry points of other packages by name; taken names are reported."""
        if self._plugins is None:
            self._plugins = {}
            found = entry_points(group=self._group) if self._group else ()
            for entry in sorted(found, key=lambda entry: (entry.name, _package(entry))):
                owner = "brrt" if entry.name in self._entries else None
                if entry.name in self._plugins:
                    owner = _package(self._plugins[entry.name])
                if owner is None:
                    self._plugins[entry.name] = entry
                else:
                    report_broken(f"{self._title(entry)} is left out: {owner} has one of this name")
        return self._plugins

    def _title(self, entry: EntryPoint) -> str:
        return f"{self._group} {entry.name!r} of package {_package(entry)}"

    def _load(self, name: str, entry: EntryPoint) -> Any:
        """Import a plug-in's object.

        Raises:
            BrrtError: It cannot be imported, or is not what the group is for.
        """
        try:
            made = entry.load()
        except (Exception, SystemExit) as error:
            why = " ".join(f"importing {entry.value} raises {error!r}".split())
            raise BrrtError(f"{self._title(entry)} is left out: {why:.300}") from error
        base = _imported(self._base) if self._base else object
        if not (isinstance(made, type) and issubclass(made, base)):
            kind = f"a subclass of {self._base.replace(':', '.')}" if self._base else "a class"
            raise BrrtError(f"{self._title(entry)} is left out: {entry.value} must be {kind}")
        if self._label and getattr(made, self._label, None) != name:
            raise BrrtError(
                f"{self._title(entry)} is left out: the attribute {self._label} of {entry.value} "
                f"must be {name!r}"
            )
        return made


def _imported(entry: str) -> Any:
    module, _, attribute = entry.partition(":")
    return getattr(import_module(module), attribute)


def _package(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module
