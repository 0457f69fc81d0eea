"""Runs drawn for Rerun, and the rows of a drawing."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from brrt import Events, Memory, Run, Scenario, forest
from brrt.views.rerun.drawing import draw_run

PLANNERS: dict[str, dict[str, Any]] = {
    "rrt": {},
    "rrt-connect": {},
    "bi-rrt": {},
    "rrt-star": {"iterations": 2000},
    "bi-rrt-star": {"iterations": 1000},
    "lrta-star": {"params": {"cell": 2.0, "lookahead": 3, "trials": 2}},
    "a-star": {"params": {"cell": 2.0}},
}


def scenario(planner: str, **values: Any) -> Scenario:
    """Return a scenario in 2D."""
    given = {"world": "squares2d:n=30,seed=3", "seed": 1, **PLANNERS[planner], **values}
    return Scenario(planner=planner, **given)


def drawn(path: Path, given: Scenario, *, batch: int = 500) -> Events:
    """Run a scenario, draw it batch by batch, and return its events."""
    run, memory = Run(given, batch=batch), Memory()
    run.execute([memory])
    draw_run(path, memory.recording(run.manifest, run.problem.world))
    return memory.events()


def entities(path: Path) -> set[str]:
    """Return all entities of a drawing."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def rows_below(path: Path, prefix: str, ending: str) -> dict[str, list[tuple[int, Any]]]:
    """Return the rows of a component, `seq` and value, of all entities with a prefix."""
    found: dict[str, list[tuple[int, Any]]] = {}
    for chunk in RrdReader(path).stream():
        if not chunk.entity_path.startswith(prefix) or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name.endswith(ending):
                rows = zip(
                    batch.column("event").to_pylist(), batch.column(name).to_pylist(), strict=True
                )
                found.setdefault(chunk.entity_path, []).extend(rows)
    return found


def rows_of(path: Path, entity: str, ending: str) -> list[tuple[int, Any]]:
    """Return the rows of a component of one entity."""
    return rows_below(path, entity, ending).get(entity, [])


def items_of(path: Path, entity: str, ending: str) -> list[Any]:
    """Return the items in all rows of one entity."""
    return [item for _, row in rows_of(path, entity, ending) for item in row]


def visible(pages: dict[str, list[tuple[int, Any]]], seq: int) -> list[Any]:
    """Return the items of pages that a viewer shows at an event: the newest row of each page."""
    items: list[Any] = []
    for page in pages.values():
        past = [value for at, value in page if at <= seq]
        items += past[-1] if past else []
    return items


def as_set(lines: Any) -> set[tuple[float, ...]]:
    """Return lines, shape (n, 2, dim), without their order."""
    return set(map(tuple, np.array(lines, np.float32).reshape(len(lines), -1).tolist()))


def edges_of(events: Events, tree: int = 0) -> NDArray[np.float32]:
    """Return the edges of a tree after some events, shape (n, 2, dim)."""
    found = forest(events)[tree]
    children = np.flatnonzero(found.parent >= 0)
    return np.stack([found.q[found.parent[children]], found.q[children]], axis=1).astype("f4")
