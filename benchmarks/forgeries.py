"""The ways in which `benchmarks/forge.py` forges recordings, with right checksums."""

import json
import os
import random
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap import records

from brrt import Events, Kind, Manifest, McapSink, Memory, Run, World
from brrt.events import Status
from brrt.formats.mcap.records import CHECKSUM
from brrt.replay.metrics import Metrics
from tests.support import forging

ESCAPES = "\x1b]0;owned\x07\x1b[2J\r\u202e[x](http://x)|\n"
_REPEATED = ("planner", "world", "robot", "seed")

TIMES = "only the order of times is judged"
VERSIONS = "nothing vouches for versions, platform and names"
CUT = "it is what an interrupted run leaves"
ELSEWHERE = "no motion of the run came near"
OTHER_RUN = "it is a correct run of the same problem"
REGISTERED = "the registered planner's is used"
HARMLESS = "the events are read as they were"


@dataclass(frozen=True)
class Base:
    """A true recording: its path, its parts, and where forgeries are written."""

    path: Path
    manifest: Manifest
    world: World
    log: Events
    rng: random.Random

    @property
    def data(self) -> forging.Parts:
        """The records of the file's data section."""
        return forging.data_of(self.path.read_bytes())

    def file(self, data: forging.Parts) -> bytes:
        """Return a file of changed records, with a right summary and right checksums."""
        declared = forging.declared_in(self.path.read_bytes())
        return forging.file_of(data, forging.summary_of(data, declared))

    def stated(self, **metadata: object) -> bytes:
        """Return the file with other fields in the manifest."""
        return self.file(self.with_metadata("brrt.run", metadata))

    def measured(self, **metrics: object) -> bytes:
        """Return the file with other metrics."""
        return self.file(self.with_metadata("brrt.result", metrics))

    def with_metadata(
        self, name: str, changes: Mapping[str, object], data: forging.Parts | None = None
    ) -> forging.Parts:
        """Return records with other fields in a metadata record; None removes a field."""
        data = data or self.data
        number = next(i for i, m in enumerate(_all(data, records.Metadata)) if m.name == name)
        known = dict(_all(data, records.Metadata)[number].metadata)
        known.pop(CHECKSUM, None)
        for key, value in changes.items():
            known.pop(key, None)
            if value is not None:
                known[key] = value if isinstance(value, str) else json.dumps(value)
        return forging.changed(data, records.Metadata, number, metadata=known)

    def scenario(self, **changes: object) -> bytes:
        """Return the file with other fields in the scenario, and in the metrics that repeat it."""
        scenario = {**self.manifest.scenario.as_dict(), **changes}
        data = self.with_metadata("brrt.run", {"scenario": scenario})
        repeated = {k: json.dumps(v) for k, v in changes.items() if k in _REPEATED}
        return self.file(self.with_metadata("brrt.result", repeated, data))

    def contract(self, change: Callable[[dict[str, Any]], Any]) -> bytes:
        """Return the file with a changed contract."""
        (run,) = (m for m in _all(self.data, records.Metadata) if m.name == "brrt.run")
        stated = json.loads(run.metadata["contract"])
        change(stated)
        return self.stated(contract=stated)

    def in_world(self, change: Callable[[dict[str, Any]], Any] | bytes) -> bytes:
        """Return the file with a changed world, or with these bytes for one."""
        if callable(change):
            stated = json.loads(self.world.to_json())
            change(stated)
            change = json.dumps(stated).encode()
        return self.file(forging.changed(self.data, records.Attachment, data=change))

    def logged(self, log: Events, manifest: Manifest | None = None) -> bytes:
        """Return a file of another log, with the metrics that follow from it."""
        manifest = manifest or self.manifest
        path = self.path.with_name("forged-log.mcap")
        metrics = Metrics(manifest)
        sink = McapSink(path, manifest, self.world)
        metrics.write(log)
        sink.write(log)
        sink.close(metrics.as_dict())
        return path.read_bytes()

    def event(self, kind: Kind, **changes: Callable[[Any], Any]) -> bytes | None:
        """Return a file in which a random event of a kind is another; None if there is none."""
        if kind not in self.log.tables:
            return None
        table = self.log[kind].copy()
        row = self.rng.randrange(len(table) // 3, len(table))
        for name, change in changes.items():
            table[name][row] = change(table[name][row])
        return self.logged(Events(self.log.dof, {**self.log.tables, kind: table}))

    def without(self, keep: Callable[[Any, Kind], Any]) -> bytes:
        """Return a file that lacks events; the others are numbered anew."""
        tables = {k: t[keep(t, k)].copy() for k, t in self.log.tables.items()}
        kept = np.sort(np.concatenate([t["seq"] for t in tables.values()]))
        for table in tables.values():
            table["seq"] = np.searchsorted(kept, table["seq"])
        return self.logged(Events(self.log.dof, {k: t for k, t in tables.items() if len(t)}))

    def body(self, raw: Callable[[bytes], bytes], compression: str = "zstd") -> bytes:
        """Return a file whose first chunk holds other bytes, and says so."""
        chunk = _all(self.data, records.Chunk)[0]
        inside = raw(zstandard.ZstdDecompressor().decompress(chunk.data))
        packed = zstandard.ZstdCompressor().compress(inside) if compression else inside
        return self.file(
            forging.changed(
                self.data, records.Chunk, data=packed, uncompressed_size=len(inside),
                uncompressed_crc=zlib.crc32(inside), compression=compression,
            )
        )  # fmt: skip

    def schema(self, change: Callable[[str], str]) -> bytes:
        """Return a file with other schemas."""

        def other(inside: forging.Parts) -> forging.Parts:
            return [
                replace(part, data=change(part.data.decode()).encode())
                if isinstance(part, records.Schema) else part
                for part in inside
            ]  # fmt: skip

        data = forging.rechunked(self.data, other)
        declared = other(forging.declared_in(self.path.read_bytes()))
        return forging.file_of(data, forging.summary_of(data, declared))


def _all(parts: forging.Parts, kind: Any) -> forging.Parts:
    return [part for part in parts if isinstance(part, kind)]


@dataclass(frozen=True)
class Attack:
    """One way to forge a file: where, what, how, and why it may pass if it may."""

    where: str
    name: str
    forge: Callable[[Base], bytes | None]
    passes: str = ""


def container() -> Iterator[Attack]:
    """Attacks on the file's records."""

    def attack(name: str, forge: Callable[[Base], bytes | None], passes: str = "") -> Attack:
        return Attack("container", name, forge, passes)

    bomb = bytes(500_000_000)
    packed = zstandard.ZstdCompressor().compress(bomb)
    yield attack(
        "a chunk of 500 MB of zeros in 50 kB",
        lambda b: b.file(
            forging.changed(
                b.data, records.Chunk, data=packed, uncompressed_size=len(bomb), uncompressed_crc=0
            )
        ),
    )
    yield attack(
        "a chunk that unpacks to more than it states",
        lambda b: b.file(
            forging.changed(
                b.data, records.Chunk, data=packed, uncompressed_size=1000, uncompressed_crc=0
            )
        ),
    )
    yield attack(
        "a chunk that states 2^62 bytes",
        lambda b: b.file(forging.changed(b.data, records.Chunk, uncompressed_size=1 << 62)),
    )
    yield attack(
        "a record longer than the file",
        lambda b: b.body(lambda raw: raw[:1] + (1 << 62).to_bytes(8, "little") + raw[9:]),
    )
    yield attack(
        "500,000 empty records",
        lambda b: b.body(lambda raw: (b"\x90" + bytes(8)) * 500_000 + raw),
        HARMLESS,
    )
    yield attack(
        "a configuration of 10^9 numbers in a schema",
        lambda b: b.schema(lambda text: text.replace("float64[", "float64[1000000000")),
    )
    yield attack(
        "a field under another name",
        lambda b: b.schema(lambda text: text.replace("iteration", "iterations")),
    )
    yield attack(
        "two manifests that differ",
        lambda b: b.file(
            [
                *b.data[:2],
                replace(b.data[1], metadata={**b.data[1].metadata, "start": "[1, 1]"}),
                *b.data[2:],
            ]
        ),
    )
    yield attack(
        "two worlds that differ",
        lambda b: b.file(
            [
                *b.data[:3],
                replace(b.data[2], data=b.data[2].data.replace(b"100.0", b"101.0")),
                *b.data[3:],
            ]
        ),
    )
    yield attack(
        "100,000 records of metadata",
        lambda b: b.file(
            [*b.data[:3], *[records.Metadata("x", {"a": "b"})] * 100_000, *b.data[3:]]
        ),
        HARMLESS,
    )
    yield attack(
        "an attachment named ../../x",
        lambda b: b.file(
            [*b.data[:3], records.Attachment(0, 0, "../../x", "text/plain", b"x"), *b.data[3:]]
        ),
        HARMLESS,
    )
    yield attack(
        "an event twice", lambda b: b.file(forging.rechunked(b.data, lambda p: [*p, p[-1]]))
    )
    yield attack(
        "an event missing",
        lambda b: b.file(forging.rechunked(b.data, lambda p: [*p[:-9], *p[-8:]])),
    )
    yield attack(
        "the summary of another file",
        lambda b: forging.file_of(
            b.data, forging.summary_of(b.data[:-2], forging.declared_in(b.path.read_bytes()))
        ),
    )


def manifest() -> Iterator[Attack]:
    """Attacks on what the file states of its run."""

    def attack(name: str, forge: Callable[[Base], bytes | None], passes: str = "") -> Attack:
        return Attack("manifest", name, forge, passes)

    yield attack("10^9 degrees of freedom", lambda b: b.stated(dof=10**9))
    yield attack("a start that is no number", lambda b: b.stated(start="[NaN, 1, 1]"))
    yield attack("another goal", lambda b: b.stated(goal=[50.0] * len(b.manifest.goal)))
    yield attack("JSON nested 200,000 deep", lambda b: b.stated(scenario="[" * 200_000))
    yield attack("a number of 100,000 digits", lambda b: b.stated(dim="9" * 100_000))
    yield attack("20,000 branches", lambda b: b.stated(format="2", branches=[{}] * 20_000))
    yield attack(
        "a robot file that is a FIFO",
        lambda b: b.stated(
            robot=None, scenario={**b.manifest.scenario.as_dict(), "robot": _fifo(b)}
        ),
    )
    yield attack("a world that names a FIFO", lambda b: b.scenario(world=_fifo(b)), VERSIONS)
    yield attack(
        "a robot of 200,000 parts",
        lambda b: b.stated(
            robot={
                "schema": "brrt.robot",
                "version": 1,
                "kind": "polygon",
                "parts": [[[0, 0], [1, 0], [0, 1]]] * 200_000,
            }
        ),
    )
    yield attack(
        "terminal escapes in versions",
        lambda b: b.stated(made_by={"brrt": ESCAPES, "numpy": ESCAPES}),
        VERSIONS,
    )
    yield attack(
        "terminal escapes in a planner's name",
        lambda b: b.scenario(planner="rrt" + ESCAPES, params={}),
        VERSIONS,
    )
    yield attack("another planner's name", lambda b: b.scenario(planner="mine"), VERSIONS)
    yield attack(
        "the planner of another contract", lambda b: b.scenario(planner="rrt-connect", params={})
    )
    yield attack("no contract", lambda b: b.stated(contract=None), REGISTERED)
    yield attack(
        "a contract with a longer step",
        lambda b: (
            b.contract(lambda c: c.update(step=4.0 * c["step"]))
            if b.manifest.scenario.planner != "lrta-star"
            else None
        ),
    )
    yield attack(
        "claims that leave out rules",
        lambda b: b.stated(
            claims={"edges": "assumed", "motions": "own", "costs": "own", "samples": "none"}
        ),
    )
    yield attack("another seed", lambda b: b.scenario(seed=99), OTHER_RUN)
    yield attack("a smaller limit of iterations", lambda b: b.scenario(iterations=3))


def world() -> Iterator[Attack]:
    """Attacks on the world."""

    def attack(name: str, forge: Callable[[Base], bytes | None], passes: str = "") -> Attack:
        return Attack("world", name, forge, passes)

    yield attack("no JSON, 200,000 deep", lambda b: b.in_world(b"[" * 200_000))
    yield attack(
        "five million lists",
        lambda b: b.in_world(b'{"schema": "brrt.world", "boxes": [' + b"[]," * 5_000_000 + b"[]]}"),
    )
    yield attack(
        "obstacles at 1e308",
        lambda b: b.in_world(lambda w: w.update(balls=[[1e308] * (b.world.dim + 1)])),
    )
    yield attack(
        "a grid of 10^12 cells",
        lambda b: b.in_world(
            lambda w: w.update(grid={"cell": 1e-4, "shape": [10**6] * b.world.dim, "data": ""})
        ),
    )
    yield attack("no obstacles", lambda b: b.in_world(lambda w: _drop(w, lambda _: True)))
    yield attack(
        "an obstacle added on the way",
        lambda b: b.in_world(lambda w: w.setdefault("balls", []).append(_on_the_way(b))),
    )
    yield attack(
        "far obstacles removed",
        lambda b: b.in_world(lambda w: _drop(w, lambda q: _far(b, q))),
        ELSEWHERE,
    )
    yield attack(
        "bounds twice as wide",
        lambda b: b.in_world(lambda w: w.update(upper=[2 * x for x in w["upper"]])),
    )
    yield attack(
        "terminal escapes in its name",
        lambda b: b.in_world(lambda w: w.update(name=ESCAPES)),
        VERSIONS,
    )


def log() -> Iterator[Attack]:
    """Attacks on the events."""

    def attack(name: str, forge: Callable[[Base], bytes | None], passes: str = "") -> Attack:
        return Attack("log", name, forge, passes)

    edges = (Kind.EDGE, Kind.EXPAND)

    def either(b: Base, **changes: Callable[[Any], Any]) -> bytes | None:
        return next((f for k in edges if (f := b.event(k, **changes)) is not None), None)

    yield attack("an edge elsewhere", lambda b: either(b, q=lambda q: q + 3.0))
    yield attack("a configuration that is no number", lambda b: either(b, q=lambda q: q * np.nan))
    yield attack(
        "a cost a thousandth lower", lambda b: b.event(Kind.EDGE, cost=lambda c: 0.999 * c)
    )
    yield attack("the number of a node 2^30", lambda b: b.event(Kind.EDGE, node=lambda _: 1 << 30))
    yield attack(
        "another parent", lambda b: b.event(Kind.EDGE, parent=lambda p: p - 1 if p > 0 else p + 1)
    )
    yield attack("tree 200", lambda b: b.event(Kind.EDGE, tree=lambda _: 200))
    yield attack("a cycle by rewiring", _cycle)
    yield attack(
        "a path that costs a hundredth less", lambda b: b.event(Kind.PATH, cost=lambda c: 0.99 * c)
    )
    yield attack("a path through whatever is between its ends", _straight)
    yield attack(
        "rejections of free motions",
        lambda b: b.event(Kind.REJECT, q=lambda _: np.asarray(b.manifest.start)),
    )
    yield attack(
        "a reason that does not exist", lambda b: b.event(Kind.REJECT, reason=lambda _: 250)
    )
    yield attack("an iteration 2^62", lambda b: b.event(Kind.PHASE, iteration=lambda _: 1 << 62))
    yield attack(
        "no samples",
        lambda b: (
            b.without(lambda t, k: np.full(len(t), k is not Kind.SAMPLE))
            if Kind.SAMPLE in b.log.tables
            else None
        ),
    )
    yield attack(
        "no rejections",
        lambda b: (
            b.without(lambda t, k: np.full(len(t), k is not Kind.REJECT))
            if Kind.REJECT in b.log.tables
            else None
        ),
    )
    yield attack("every second sample twice", _repeated)
    yield attack("times halved", lambda b: b.logged(_timed(b.log, lambda t: t // 2)), TIMES)
    yield attack("times in reverse", lambda b: b.logged(_timed(b.log, lambda t: t.max() - t)))
    yield attack(
        "the log cut in the middle of an iteration",
        lambda b: b.logged(b.log.until(seq=_planned(b) // 2)),
    )
    yield attack("the log ended early, as by Ctrl-C", _interrupted, CUT)
    yield attack("another run of the problem", _another, OTHER_RUN)


def result() -> Iterator[Attack]:
    """Attacks on the metrics."""

    def attack(name: str, forge: Callable[[Base], bytes | None], passes: str = "") -> Attack:
        return Attack("result", name, forge, passes)

    yield attack(
        "another outcome", lambda b: b.measured(solved=False, status=json.dumps("iteration limit"))
    )
    yield attack("a shorter path", lambda b: b.measured(path_cost=1.5))
    yield attack("fewer events", lambda b: b.measured(events=7))
    yield attack("a time of planning of 1 ns", lambda b: b.measured(plan_time_s=1e-9))
    yield attack(
        "10^6 metrics of no name", lambda b: b.measured(**{f"x{i}": 1 for i in range(10**6)})
    )


def _fifo(base: Base) -> str:
    path = base.path.with_name("pipe.json")
    if not path.exists():
        os.mkfifo(path)
    return str(path)


def _obstacles(world: dict[str, Any]) -> Iterator[tuple[str, list[Any]]]:
    yield from ((kind, world[kind]) for kind in ("balls", "boxes", "polygons") if world.get(kind))


def _drop(world: dict[str, Any], drop: Callable[[list[float]], bool]) -> None:
    for kind, found in _obstacles(world):
        world[kind] = [each for each in found if not drop(each)]


def _far(base: Base, obstacle: Any) -> bool:
    """Whether an obstacle is farther than 30 from whatever the log has."""
    dim = base.world.dim
    center = np.ravel(np.asarray(obstacle, float))[:dim]
    seen = [t["q"].reshape(len(t), -1)[:, :dim] for k, t in base.log.tables.items()
            if "q" in (t.dtype.names or ()) and k is not Kind.SAMPLE]  # fmt: skip
    return bool(min(np.linalg.norm(q - center, axis=1).min() for q in seen) > 30)


def _on_the_way(base: Base) -> list[float]:
    path = base.log[Kind.PATH]["waypoints"][-1] if Kind.PATH in base.log.tables else None
    middle = base.log[Kind.EDGE]["q"][-1] if path is None else path[len(path) // 2]
    return [*map(float, middle[: base.world.dim]), 0.5]


def _cycle(base: Base) -> bytes | None:
    """Give an inner node of the path one of its descendants as its parent."""
    if Kind.EDGE not in base.log.tables:
        return None
    table = base.log[Kind.EDGE].copy()
    row = base.rng.randrange(2, len(table))
    table["parent"][row] = table["node"][row]
    return base.logged(Events(base.log.dof, {**base.log.tables, Kind.EDGE: table}))


def _straight(base: Base) -> bytes | None:
    """Leave out all waypoints of the last path but its ends; it costs their distance."""
    table = base.log[Kind.PATH].copy()
    ways = table["waypoints"][-1]
    if len(ways) < 4:
        return None
    table["waypoints"][-1] = ways[[0, -1]]
    return base.logged(Events(base.log.dof, {**base.log.tables, Kind.PATH: table}))


def _repeated(base: Base) -> bytes | None:
    if Kind.SAMPLE not in base.log.tables:
        return None
    table = base.log[Kind.SAMPLE].copy()
    table["q"][1::2] = table["q"][: 2 * (len(table) // 2) : 2]
    return base.logged(Events(base.log.dof, {**base.log.tables, Kind.SAMPLE: table}))


def _timed(log: Events, change: Callable[[Any], Any]) -> Events:
    order = np.sort(np.concatenate([t["t"] for t in log.tables.values()]))
    times = np.sort(change(order)) if change(np.array([0, 1]))[0] == 0 else change(order)
    tables = {k: t.copy() for k, t in log.tables.items()}
    for table in tables.values():
        table["t"] = times[table["seq"]]
    return Events(log.dof, tables)


def _planned(base: Base) -> int:
    """Return the number of the event that ends planning."""
    phases = base.log[Kind.PHASE]
    return int(phases["seq"][phases["status"] != Status.BEGIN][0])


def _interrupted(base: Base) -> bytes:
    """Return a log that ends after half of the iterations, with the status of an interrupt."""
    phases = base.log[Kind.PHASE]
    at = int(np.flatnonzero(phases["seq"] == _planned(base))[0])
    half = int(phases["iteration"][at]) // 2
    rows = [t[t["iteration"] > half] for k, t in base.log.tables.items()]
    first = min(int(t["seq"][0]) for t in rows if len(t))
    log, end = base.log.until(seq=first - 1), phases[at : at + 1].copy()
    end["seq"], end["iteration"], end["status"] = first, half, Status.INTERRUPTED
    end["t"] = max(int(t["t"][-1]) for t in log.tables.values() if len(t)) + 1
    table = np.concatenate([log[Kind.PHASE], end])
    return base.logged(Events(log.dof, {**log.tables, Kind.PHASE: table}))


def _another(base: Base) -> bytes:
    """Return the log of another seed under this one's manifest."""
    memory, run = Memory(), Run(replace(base.manifest.scenario, seed=77), world=base.world)
    run.execute([memory])
    return base.logged(memory.events())


ATTACKS = [attack for group in (container, manifest, world, log, result) for attack in group()]
