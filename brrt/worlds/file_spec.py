"""World files as users name them: `FILE[:name=value,...][#query]`."""

from pathlib import Path
from typing import NamedTuple

from brrt.files import is_file, is_there


class FileSpec(NamedTuple):
    """A world file with the settings of its loader and a query.

    Attributes:
        path: The file.
        params: Settings of the loader, as `name=value,...`; empty by default.
        query: Which start and goal, of a file with several, such as `12`; empty by default.
    """

    path: Path
    params: str
    query: str

    @classmethod
    def parse(cls, spec: str) -> "FileSpec":
        """Split a specification into its parts.

        The file is the longest part before a `:` or `#` that exists as a file. If none exists, it
        ends at the first `:name=` or `#`.
        """
        if is_there(spec):
            return cls(Path(spec), "", "")
        cuts = [i for i, letter in enumerate(spec) if letter in ":#"]
        existing = [i for i in cuts if is_file(spec[:i])]
        named = (i for i in cuts if _is_cut(spec, i))
        cut = existing[-1] if existing else next(named, len(spec))
        path, rest = Path(spec[:cut]), spec[cut:]
        if rest.startswith("#"):
            return cls(path, "", rest[1:])
        params, number, query = rest[1:].rpartition("#")
        return cls(path, params, query) if number else cls(path, query, "")


def _is_cut(spec: str, i: int) -> bool:
    """Whether parameters or a query begin at a `:` or `#`; False for the `:` of `C:`."""
    name, equals, _ = spec[i + 1 :].partition("=")
    return spec[i] == "#" or bool(equals and name.strip().isidentifier())
