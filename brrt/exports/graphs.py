"""The trees of a run at an instant, or the cells of a search, as a graph."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind
from brrt.exports.extras import need
from brrt.exports.tables import Columns, coordinate_names, node_columns
from brrt.files import replacing
from brrt.recording import Recording
from brrt.replay.snapshot import Snapshot, snapshot
from brrt.text import readable, visible

Node = tuple[int, int]
"""Tree and number; cells are in tree 0."""

_BY_TYPE = {bool: "boolean", int: "long", float: "double", str: "string"}
_NOT_FINITE = {"inf": "INF", "-inf": "-INF", "nan": "NaN"}
_NOT_XML = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """A directed graph: edges lead from parents to children, links between trees from tree 0.

    Attributes:
        about: Attributes of the graph: planner, world, seed.
        nodes: For each node its tree, its number, cost, the `seq` of its event, its configuration.
        edges: For each edge `source` and `target`, rows of `nodes`; `kind`, "edge" or "link"; and
            its length in the robot's metric.
    """

    about: dict[str, Any]
    nodes: Columns
    edges: Columns

    def names(self) -> list[Node]:
        """Return tree and number of each node."""
        return list(zip(self.nodes["tree"].tolist(), self.nodes["node"].tolist(), strict=True))


def graph_of(run: Snapshot) -> Graph:
    """Return the graph of a run at an instant.

    Raises:
        LogError: The events do not make trees.
    """
    recording = run.recording
    scenario, names = recording.manifest.scenario, coordinate_names(recording)
    texts = {"planner": scenario.planner, "world": scenario.world}
    about = {key: visible(readable(text), one_line=True) for key, text in texts.items()}
    nodes = node_columns(run, names) or _cells(run, names)
    tree, node, parent = (nodes[name] for name in ("tree", "node", "parent"))
    row = {key: i for i, key in enumerate(zip(tree.tolist(), node.tolist(), strict=True))}
    above = zip(tree.tolist(), parent.tolist(), strict=True)
    edges = [(row[key], child) for child, key in enumerate(above) if key in row]
    links = [(row[a], row[b]) for a, b in _links(run) if a in row and b in row]
    source, target = np.array([*edges, *links], np.int64).reshape(-1, 2).T
    q = np.stack([nodes[name] for name in nodes if name.startswith("q_")], axis=-1)
    kinds = np.array(["edge"] * len(edges) + ["link"] * len(links), object)
    lengths = np.asarray(recording.robot().distance(q[source], q[target]))
    return Graph(
        {**about, "seed": scenario.seed},
        {name: column for name, column in nodes.items() if name != "parent"},
        {"source": source, "target": target, "kind": kinds, "length": lengths},
    )


def _links(run: Snapshot) -> Iterator[tuple[Node, Node]]:
    """Yield the ends of edges beside those to parents: between two trees, and of graphs."""
    for link in run.events[Kind.CONNECT]:
        yield (0, int(link["node"])), (1, int(link["other"]))
    for number, tree in run.forest.items():
        for link in tree.links:
            yield (number, int(link["node"])), (number, int(link["other"]))


def _cells(run: Snapshot, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Return the cells that a search expanded, each as it was expanded last."""
    table = run.events[Kind.EXPAND]
    _, last = np.unique(table["cell"][::-1], return_index=True)
    rows = table[len(table) - 1 - last]
    columns = {
        "tree": np.zeros(len(rows), np.int64), "node": rows["cell"], "parent": rows["parent"],
        "cost": rows["cost"], "seq": rows["seq"],
    }  # fmt: skip
    return columns | {f"q_{name}": rows["q"][:, k] for k, name in enumerate(names)}


def to_networkx(recording: Recording, **instant: Any) -> Any:
    """Return the trees of a run as a `networkx.DiGraph`.

    Its nodes are (tree, number), with the attributes cost, seq and q_x ...; its edges lead from
    parents to children, with the attributes kind and length.

    Args:
        recording: The run.
        instant: `time`, `event` or `iteration`, as `brrt.snapshot` takes them.

    Raises:
        BrrtError: networkx is missing, or the instant is wrong.
        LogError: The events do not make trees.
    """
    networkx, graph = need("networkx"), graph_of(snapshot(recording, **instant))
    made, keys = networkx.DiGraph(**graph.about), graph.names()
    made.add_nodes_from(zip(keys, _rows(graph.nodes), strict=True))
    ends = (graph.edges["source"].tolist(), graph.edges["target"].tolist())
    attributes = {name: graph.edges[name] for name in ("kind", "length")}
    rows = zip(*ends, _rows(attributes), strict=True)
    made.add_edges_from((keys[a], keys[b], values) for a, b, values in rows)
    return made


def _rows(columns: Columns) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table, with Python's own numbers."""
    for row in zip(*(column.tolist() for column in columns.values()), strict=True):
        yield dict(zip(columns, row, strict=True))


def write_graphml(run: Snapshot, path: Path) -> int:
    """Write the trees of a run at an instant as GraphML; return the number of nodes.

    Numbers have as many digits, 17 at most, as it takes to read them back bit for bit.

    Raises:
        BrrtError: The file cannot be written.
        LogError: The events do not make trees.
    """
    graph = graph_of(run)
    with replacing(path) as unfinished, unfinished.open("w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in _graphml(graph))
    return len(graph.nodes["node"])


def _graphml(graph: Graph) -> Iterator[str]:
    edges = {name: graph.edges[name] for name in ("kind", "length")}
    first = {
        "graph": graph.about, "node": next(_rows(graph.nodes), {}), "edge": next(_rows(edges), {}),
    }  # fmt: skip
    yield '<?xml version="1.0" encoding="utf-8"?>'
    yield '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    for domain, values in first.items():
        for name, value in values.items():
            key, kind = quoteattr(f"{domain}_{name}"), _BY_TYPE[type(value)]
            yield f'  <key id={key} for="{domain}" attr.name={quoteattr(name)} attr.type="{kind}"/>'
    yield '  <graph id="trees" edgedefault="directed">'
    yield from _data("graph", graph.about)
    names = [f"{tree}:{node}" for tree, node in graph.names()]
    for name, values in zip(names, _rows(graph.nodes), strict=True):
        yield f'    <node id="{name}">{"".join(_data("node", values))}</node>'
    ends = (graph.edges["source"].tolist(), graph.edges["target"].tolist())
    for a, b, values in zip(*ends, _rows(edges), strict=True):
        data = "".join(_data("edge", values))
        yield f'    <edge source="{names[a]}" target="{names[b]}">{data}</edge>'
    yield "  </graph>"
    yield "</graphml>"


def _data(domain: str, values: dict[str, Any]) -> Iterable[str]:
    for name, value in values.items():
        yield f"<data key={quoteattr(f'{domain}_{name}')}>{_text(value)}</data>"


def _text(value: Any) -> str:
    """Return a value as XML Schema writes it."""
    if isinstance(value, float):
        return repr(value) if isfinite(value) else _NOT_FINITE[repr(value)]
    return escape(_NOT_XML.sub("?", str(value)))
