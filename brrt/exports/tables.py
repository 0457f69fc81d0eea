"""A run at an instant as tables of plain columns, made from the declaration of the events."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError, LogError
from brrt.events import FIELDS, Choices, Field, Kind, Table
from brrt.recording import Recording
from brrt.replay.snapshot import Snapshot
from brrt.text import visible

Columns = Mapping[str, NDArray[Any]]
"""Columns of equal length by name: numbers, truth values, or texts."""

NODES, BEST_PATH = "nodes", "best_path"

_HEAD = ("seq", "t", "iteration")


def table_names() -> set[str]:
    """Return the names of all tables that a run may have."""
    parts = {f"{kind.key}_{field.name}" for kind, field in _lists()}
    return {NODES, BEST_PATH, *parts, *(kind.key for kind in Kind)}


def _lists() -> Iterator[tuple[Kind, Field]]:
    """Yield the fields that hold several configurations."""
    for kind in Kind:
        yield from ((kind, field) for field in FIELDS[kind] if field.type == "q[]")


def tables(snapshot: Snapshot) -> dict[str, Columns]:
    """Return the tables of a run at an instant, by name.

    There is one for each kind of event that occurs, one for the configurations of each field that
    has several, `nodes` for the trees and `best_path` for the best path so far, if there is one.
    Events that make no tree have no `nodes`.
    """
    events, coordinates = snapshot.events, coordinate_names(snapshot.recording)
    found: dict[str, Columns] = {}
    for kind in Kind:
        table = events[kind]
        if not len(table):
            continue
        found[kind.key] = _event_columns(kind, table, coordinates)
        for field in FIELDS[kind]:
            if field.type == "q[]":
                found[f"{kind.key}_{field.name}"] = _several(field, table, coordinates)
    with suppress(LogError):
        nodes = node_columns(snapshot, coordinates)
        if nodes:
            found[NODES] = nodes
    best = snapshot.best_path
    if best is not None:
        path = np.asarray(best[1], np.float64).reshape(-1, events.dof)
        found[BEST_PATH] = {"waypoint": np.arange(len(path)), **_split("q", path, coordinates)}
    return found


def coordinate_names(recording: Recording) -> tuple[str, ...]:
    """Return the names of the numbers in a configuration: x, y ..., or 1, 2 ... if unknown."""
    numbers = tuple(str(k + 1) for k in range(recording.manifest.dof))
    try:
        names = recording.robot().coordinates(recording.world)
    except BrrtError:
        return numbers
    plain = tuple(visible(name, one_line=True) for name in names)
    return plain if len(set(plain)) == len(numbers) else numbers


def node_columns(snapshot: Snapshot, coordinates: tuple[str, ...]) -> Columns:
    """Return the nodes of all trees, removed ones left out; no columns if there is no tree.

    Raises:
        LogError: The events do not make trees.
    """
    trees = snapshot.forest
    if not trees:
        return {}
    parts = []
    for number, tree in trees.items():
        rows = np.setdiff1d(np.arange(len(tree)), tree.removed)
        parts.append({
            "tree": np.full(len(rows), number), "node": rows, "parent": tree.parent[rows],
            "cost": tree.cost[rows], "seq": tree.born[rows],
            **_split("q", tree.q[rows], coordinates),
        })  # fmt: skip
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _event_columns(kind: Kind, table: Table, coordinates: tuple[str, ...]) -> Columns:
    columns: dict[str, NDArray[Any]] = {name: table[name] for name in _HEAD}
    for field in FIELDS[kind]:
        values = table[field.name]
        if field.type == "q":
            columns |= _split(field.name, values, coordinates)
        elif field.type == "q[]":
            columns[field.name] = np.array([len(each) for each in values], np.int64)
        elif field.choices is not None:
            columns[field.name] = _labels(field.choices, values)
        else:
            columns[field.name] = values
    return columns


def _labels(choices: Choices, values: NDArray[Any]) -> NDArray[Any]:
    """Return the names of numbers from a log as texts; a number that is unknown stays one."""
    codes, rows = np.unique(values, return_inverse=True)
    known = {int(each): each.key for each in choices}
    names = [known.get(code, str(code)) for code in codes.tolist()]
    return np.array(names, object)[rows]


def _split(name: str, q: NDArray[Any], coordinates: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Return configurations, shape (n, dof), as one column a number."""
    return {f"{name}_{each}": q[:, k] for k, each in enumerate(coordinates)}


def _several(field: Field, table: Table, coordinates: tuple[str, ...]) -> Columns:
    """Return the configurations of a field that has several, with the number of their event."""
    each = [np.asarray(q, np.float64).reshape(-1, len(coordinates)) for q in table[field.name]]
    counts = [len(q) for q in each]
    return {
        "seq": np.repeat(table["seq"], counts),
        "waypoint": np.concatenate([np.arange(count) for count in counts]),
        **_split("q", np.concatenate(each), coordinates),
    }
