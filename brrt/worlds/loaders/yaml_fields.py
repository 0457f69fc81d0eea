"""Fields of a YAML file as plain text and numbers; YAML objects are never constructed."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Self

import yaml

from brrt.errors import BrrtError
from brrt.files import read_text
from brrt.worlds.loaders.loader import finite

_PLAIN = {f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "seq")}


class YamlFields(NamedTuple):
    """The top-level fields of a YAML file as nodes, which know their line numbers.

    Nodes are not constructed, so that tags call nothing, and aliases and merges expand to nothing.
    """

    path: Path
    nodes: Mapping[str, yaml.Node]

    @classmethod
    def read(cls, path: Path, most_bytes: int) -> Self:
        """Read a file.

        Raises:
            BrrtError: The file cannot be read, is too large, or is not a mapping in YAML.
        """
        text = read_text(path, "a map's yaml", most_bytes)
        try:
            root = yaml.compose(text, yaml.SafeLoader)
        except yaml.MarkedYAMLError as error:
            line = error.problem_mark.line + 1 if error.problem_mark else 1
            raise BrrtError(f"{path}:{line}: not YAML: {error.problem}") from None
        except yaml.YAMLError as error:
            raise BrrtError(f"{path}: not YAML: {str(error).splitlines()[0][:80]}") from None
        except RecursionError:
            raise BrrtError(f"{path}: not a map's YAML: it is nested too deeply") from None
        if not isinstance(root, yaml.MappingNode):
            raise BrrtError(
                f"{path}: not a map's YAML: it must consist of fields like 'resolution: 0.05'"
            )
        nodes: dict[str, yaml.Node] = {}
        for key, value in root.value:
            where = f"{path}:{key.start_mark.line + 1}"
            name = _text(f"{where}: the name of a field", key)
            if name in nodes:
                raise BrrtError(f"{where}: a second field {name[:40]!r}")
            nodes[name] = value
        return cls(path, nodes)

    def where(self, name: str) -> str:
        """Return file, line and field, for messages."""
        return f"{self.path}:{self.nodes[name].start_mark.line + 1}: {name}"

    def text(self, name: str) -> str:
        """Return a plain value as it is written."""
        return _text(self.where(name), self.nodes[name])

    def number(self, name: str) -> float:
        """Return a finite number."""
        return finite(self.where(name), [self.text(name)])[0]

    def numbers(self, name: str, what: str) -> list[float]:
        """Return a list of finite numbers, one for each word of `what`."""
        node, where = self.nodes[name], self.where(name)
        count = len(what.split())
        if not isinstance(node, yaml.SequenceNode) or len(node.value) != count:
            raise BrrtError(f"{where} must be {count} numbers: [{what}]")
        return finite(where, [_text(where, part) for part in node.value])


def _text(where: str, node: yaml.Node) -> str:
    if node.tag not in _PLAIN:
        raise BrrtError(f"{where} must be a plain value, without the tag {node.tag[:60]!r}")
    if not isinstance(node, yaml.ScalarNode):
        raise BrrtError(f"{where} must be a single value")
    return str(node.value)
