"""`brrt.hpp`: the same file as the recorder in Python writes, and whole ones whatever happens."""

import json
import re
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brrt
from brrt import Kind, World, forest, read, record, verify
from brrt.events import Status
from brrt.formats.mcap.messages import definition
from brrt.formats.mcap.reader import is_whole
from tests.support.compiler import INCLUDE, ROOT, STRICT, compiled

SOURCE = Path(__file__).with_name("record.cpp")
Ways = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the program that records in several ways."""
    return compiled(SOURCE, tmp_path_factory.mktemp("cpp") / "record", "-O0", *STRICT)


@pytest.fixture
def ways(program: Path) -> Ways:
    """Run the program: `ways("every", path)`."""

    def run(way: str, path: Path, **kw: Any) -> "subprocess.CompletedProcess[str]":
        command = [str(program), way, str(path)]
        return subprocess.run(command, capture_output=True, text=True, check=False, **kw)

    return run


def every_call(path: Path) -> None:
    """Make the calls of `every` in record.cpp."""
    times = iter(range(1000, 1_000_000, 1000))
    world = World(
        "open",
        lower=np.zeros(2),
        upper=np.full(2, 10.0),
        boxes=np.array([[4, 0, 5, 0.5]]),
        balls=np.array([[8, 1, 0.25]]),
        polygons=(np.array([[0, 9], [0.5, 9], [0.25, 9.5]]),),
    )
    rec = record(
        path, world=world, start=(1, 1), goal=(9, 9), planner="mine", seed=4, iterations=100,
        time_limit=2.5, params={"step": 2, "name": 'ü "x"\n', "on": True},
        contract=brrt.Contract(step=8.0), clock=lambda: next(times),
        claims={"edges": "assumed", "goal_tolerance": 0.5},
    )  # fmt: skip
    rec.edge((1, 1))
    rec.sample((1, 9))
    node = rec.edge((1, 9), 0)
    rec.sample((9, 9), "goal")
    rec.reject((9, 9), node, "no_progress")
    rec.edge((4, 5), node)
    rec.edge((9, 9), 2, cost=20.0)
    rec.path([[1, 1], [1, 9], [4, 5], [9, 9]])
    rec.rewire(2, 0)
    rec.edge((9, 8), 3)
    rec.path([[1, 1], [4, 5], [9, 9]])
    rec.path([[1, 1], [9, 9]], cost=12, stage="smoothed")
    rec.edge((9, 9), tree=1)
    rec.edge((8, 8), 0, tree=1)
    rec.connect(1, 1)
    rec.iteration = 7
    rec.expand(3, -1, (2, 2), 1.5)
    rec.vertex((3, 3))
    rec.link(0, 5)
    rec.link(5, 4, cost=9)
    rec.check(0, 5)
    rec.check(0, None, 0.25, q=(7, 7))
    rec.cut(4, 5)
    rec.rewire(5, 0)
    rec.cut(5)
    rec.remove(2)
    rec.close(Status.ITERATION_LIMIT)


def test_same_file_as_python(tmp_path: Path, ways: Ways) -> None:
    """Manifest, world, every event and the metrics are equal; costs are, within rounding."""
    every_call(tmp_path / "python.mcap")
    assert ways("every", tmp_path / "cpp.mcap").returncode == 0
    python, cpp = read(tmp_path / "python.mcap"), read(tmp_path / "cpp.mcap")
    same = {name: getattr(python.manifest, name) for name in ("epoch_ns", "made_by")}
    assert replace(cpp.manifest, **same) == python.manifest
    assert cpp.world.to_json() == python.world.to_json()
    assert {kind for kind, count in (cpp.counts or {}).items() if count} >= {
        Kind.EXPAND, Kind.VERTEX, Kind.LINK, Kind.CUT, Kind.REMOVE, Kind.CHECK, Kind.CONNECT,
    }  # fmt: skip
    assert cpp.events().counts == python.events().counts
    for kind in cpp.events().counts:
        a, b = cpp.events()[kind], python.events()[kind]
        for name in a.dtype.names or ():
            if name == "waypoints":
                for one, other in zip(a[name], b[name], strict=True):
                    np.testing.assert_array_equal(one, other)
            else:
                rtol = 1e-15 if name == "cost" else 0
                np.testing.assert_allclose(a[name], b[name], rtol=rtol, err_msg=f"{kind} {name}")
    assert cpp.result is not None
    assert python.result is not None
    assert set(python.result) - set(cpp.result) == {"counted_iterations"}
    for name, value in cpp.result.items():
        if isinstance(value, float):
            assert value == pytest.approx(python.result[name]), name
        else:
            assert value == python.result[name], name
    assert {f.rule for f in verify(cpp).findings} == {f.rule for f in verify(python).findings}


def test_file_is_whole(tmp_path: Path, ways: Ways) -> None:
    """Checksums, schemas and indexes are right, by brrt's reader and by that of mcap."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    path = tmp_path / "cpp.mcap"
    ways("every", path)
    assert is_whole(path)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        found = [message for _, _, message, _ in reader.iter_decoded_messages()]
        names = [(each.name, each.metadata) for each in reader.iter_metadata()]
    assert summary is not None
    assert [message.sequence for message in found] == list(range(len(found)))
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(found)
    assert [name for name, _ in names] == ["brrt.run", "brrt.result"]
    texts = {schema.name: schema.data.decode() for schema in summary.schemas.values()}
    for kind in Kind:
        assert texts[f"brrt_msgs/msg/{kind.label.capitalize()}"] == definition(kind, 2)


def test_threads(tmp_path: Path, ways: Ways) -> None:
    """No event is lost or doubled where four threads call."""
    assert ways("threads", tmp_path / "run.mcap").returncode == 0
    recording = read(tmp_path / "run.mcap")
    log = recording.events()
    assert len(log[Kind.SAMPLE]) == 80000
    assert sorted(log[Kind.EDGE]["node"].tolist()) == list(range(80001))
    assert not verify(recording).findings


def test_robots_and_worlds(tmp_path: Path, ways: Ways) -> None:
    """A polygon in a grid has its own metric; without a world the robot is opaque."""
    ways("lorry", tmp_path / "lorry.mcap")
    recording = read(tmp_path / "lorry.mcap")
    assert recording.world.grid is not None
    assert np.argwhere(recording.world.grid.cells).tolist() == [[1, 2]]
    q, robot = recording.events()[Kind.EDGE]["q"], recording.robot()
    costs = np.cumsum([0, *robot.distance(q[:-1], q[1:])])
    assert recording.events()[Kind.EDGE]["cost"] == pytest.approx(costs)
    assert not verify(recording).findings
    ways("unknown", tmp_path / "unknown.mcap")
    with record(tmp_path / "python.mcap", start=range(7), goal=np.ones(7)):
        pass
    recording, python = read(tmp_path / "unknown.mcap"), read(tmp_path / "python.mcap")
    assert json.loads(recording.world.to_json()) == json.loads(python.world.to_json())
    assert recording.robot() == python.robot()
    assert not verify(recording).findings


def test_wrong_values_are_refused(tmp_path: Path, ways: Ways) -> None:
    """Each is an error at the call that names the field; what was recorded is right."""
    done = ways("wrong", tmp_path / "run.mcap")
    assert done.returncode == 0, done.stderr
    lines = dict(line.split(": ", 1) for line in done.stdout.splitlines())
    assert len(lines) == 19
    assert "taken" not in lines.values()
    assert "name a file that ends in .mcap" in lines["name"]
    assert "No such file" in lines["folder"]
    for field in ("tree", "parent", "cost", "node", "part", "iteration"):
        assert lines[field].startswith(field), lines[field]
    assert not verify(read(tmp_path / "run.mcap")).findings


def test_exception_ends_the_run_as_interrupted(tmp_path: Path, ways: Ways) -> None:
    """The file is whole, and the exception is passed on."""
    done = ways("throws", tmp_path / "run.mcap")
    assert done.stdout == "the planner failed\n"
    recording = read(tmp_path / "run.mcap")
    assert recording.result is not None
    assert recording.result["status"] == "interrupted"
    assert not verify(recording).findings


def test_abort_leaves_a_readable_file(tmp_path: Path, ways: Ways) -> None:
    """Up to the last flush."""
    assert ways("aborts", tmp_path / "run.mcap").returncode == -signal.SIGABRT
    log = read(tmp_path / "run.mcap", partial=True).events()
    assert log[Kind.EDGE]["q"].tolist() == [[1, 1]]


def test_full_disk(tmp_path: Path, ways: Ways) -> None:
    """It is reported once; the planner goes on, and what was written can be read."""

    def small() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # writes fail instead
        resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, 3_000_000))

    done = ways("full", tmp_path / "run.mcap", preexec_fn=small)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 report, node 1: cannot write ")
    recording = read(tmp_path / "run.mcap", partial=True)
    assert 10_000 < len(recording.events()[Kind.SAMPLE]) < 100_000
    assert recording.result is None
    assert len(forest(recording.events())[0]) == 1


@pytest.mark.slow
def test_killed_process_loses_half_a_second_at_most(tmp_path: Path, program: Path) -> None:
    """The program prints how many events are half a second old, and is killed then."""
    path = tmp_path / "run.mcap"
    with subprocess.Popen([program, "forever", path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(3):
            least = int(process.stdout.readline())
        process.kill()
    log = read(path, partial=True).events()
    assert len(log) >= least > 1000
    assert not verify(read(path, partial=True)).findings


@pytest.mark.slow
@pytest.mark.parametrize(
    ("compiler", "options"),
    [
        ("g++", ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")),
        ("g++", ("-fsanitize=thread",)),
        ("clang++", ()),
    ],
    ids=["address", "thread", "clang"],
)
def test_sanitizers_and_compilers(compiler: str, options: tuple[str, ...], tmp_path: Path) -> None:
    """No compiler has a warning, and no sanitizer reports anything."""
    options = ("-O1", "-g", *STRICT, *options)
    program = compiled(SOURCE, tmp_path / "record", *options, compiler=compiler)
    for way in ("every", "threads", "wrong", "unknown", "lorry", "throws"):
        path = tmp_path / f"{way}.mcap"
        done = subprocess.run([program, way, path], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
        assert is_whole(path)


@pytest.mark.slow
def test_example_by_cmake(tmp_path: Path) -> None:
    """`find_package(brrt)` finds the headers; the example plans, and its file verifies."""
    if shutil.which("cmake") is None:
        pytest.skip("needs cmake")
    build = tmp_path / "build"
    folders: list[str | Path] = [
        f"-Dbrrt_DIR={ROOT / 'brrt' / 'cmake'}",
        "-S",
        ROOT / "examples" / "cpp",
    ]
    commands: list[list[str | Path]] = [
        ["cmake", *folders, "-B", build],
        ["cmake", "--build", build, "--target", "rrt"],
        [build / "rrt", tmp_path / "run.mcap"],
    ]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    recording = read(tmp_path / "run.mcap")
    assert recording.result is not None
    assert recording.result["solved"]
    assert not verify(recording).findings


@pytest.mark.slow
def test_program_of_the_page(tmp_path: Path) -> None:
    """What docs/cpp.md shows compiles and records."""
    blocks = re.findall(r"```cpp\n(.*?)```", (ROOT / "docs" / "cpp.md").read_text(), re.DOTALL)
    source = tmp_path / "mine.cpp"
    source.write_text(blocks[0])
    program = compiled(source, tmp_path / "mine", *STRICT)
    assert subprocess.run([program], cwd=tmp_path, check=False).returncode == 0
    assert len(read(tmp_path / "mine.mcap").events()) == 7


def test_include_dir(brrt: Callable[..., Any]) -> None:
    """The commands print folders that have the headers and the CMake package."""
    include, cmake = brrt("include-dir").out.strip(), brrt("include-dir", "--cmake-dir").out.strip()
    assert Path(include).samefile(INCLUDE)
    assert (Path(include) / "brrt" / "brrt.hpp").is_file()
    assert (Path(cmake) / "brrtConfig.cmake").is_file()
