"""The buffer of events: no field of any kind is lost on the way from a kernel to a table."""

import importlib.util
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any, get_args

import numpy as np
import pytest

from brrt import event_columns
from brrt.events import COUNTS, FIELDS, Field, Kind, table_dtype
from brrt.kernels import emit, event_log
from brrt.kernels.jit import config, kernel

DOF = 3
Q = np.arange(40.0).reshape(-1, DOF + 1)[:, :DOF].copy()
WIDE = (
    Field("first", "float64", "a number"),
    Field("count", "int32", "a number"),
    Field("start", "q", "a configuration"),
    Field("way", "q[]", "waypoints"),
    Field("second", "float64", "another number"),
    Field("end", "q", "another configuration"),
    Field("over", "q[]", "more waypoints"),
)


def values(fields: tuple[Field, ...]) -> dict[str, Any]:
    """A different value for each field."""
    found: dict[str, Any] = {}
    for i, f in enumerate(fields, 1):
        others = {"q": Q[i], "q[]": Q[i : i + 2], "bool": True}
        found[f.name] = others.get(f.type, 10 + i)
    return found


def arguments(buffer: emit.Buffer, fields: tuple[Field, ...]) -> list[Any]:
    """The same values as the arguments of a kind's function; waypoints are put into the buffer."""
    found: list[Any] = []
    for i, (f, value) in enumerate(zip(fields, values(fields).values(), strict=True), 1):
        if f.type == "q":
            found += [Q, i]
        elif f.type == "q[]":
            first = int(buffer.state[event_columns.POINTS])
            buffer.points[first : first + len(value)] = value
            buffer.state[event_columns.POINTS] += len(value)
            found += [first, len(value)]
        else:
            found.append(float(value) if f.type.startswith("float") else value)
    return found


def callable_from_python(emit: ModuleType, kind: Kind) -> Any:
    """Compile a kernel that calls the function of a kind, under a name for each set of fields."""
    count = sum(2 if f.type in ("q", "q[]") else 1 for f in FIELDS[kind])
    name, rest = f"call_{kind.key}_{count}", ", ".join(f"a{i}" for i in range(count + 2))
    source = f"def {name}({rest}):\n    emit_{kind.key}({rest})"
    made: dict[str, Any] = {}
    exec(compile(source, __file__, "exec"), vars(emit).copy(), made)  # noqa: S102
    return kernel(made[name])


def check_round_trip(emit: ModuleType, event_log: ModuleType, kind: Kind) -> None:
    """Every field of an event of a kernel and of Python has its value in the table."""
    log, fields = event_log.EventLog(DOF, logical_clock=True), FIELDS[kind]
    call = callable_from_python(emit, kind)
    for iteration in (1, 2):
        call(log.buffer, iteration, *arguments(log.buffer, fields))
    log.emit(kind, 3, **values(fields))
    table = log.drain()[kind]
    assert table["iteration"].tolist() == [1, 2, 3]
    assert table["seq"].tolist() == [0, 1, 2]
    for name, value in values(fields).items():
        for row in table:
            np.testing.assert_array_equal(row[name], value, err_msg=name)


@pytest.mark.parametrize("kind", Kind)
def test_every_field_comes_back(kind: Kind) -> None:
    """Of every kind."""
    check_round_trip(emit, event_log, kind)


@pytest.fixture
def wide(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[ModuleType, ModuleType]]:
    """Load the modules with a kind that has two numbers, configurations and paths."""
    monkeypatch.setitem(FIELDS, Kind.CONNECT, WIDE)
    table_dtype.cache_clear()
    modules = []
    for module in (event_columns, emit, event_log):
        spec = importlib.util.spec_from_file_location(module.__name__, module.__file__)
        assert spec is not None
        assert spec.loader is not None
        again = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, module.__name__, again)
        spec.loader.exec_module(again)
        modules.append(again)
    yield modules[1], modules[2]
    table_dtype.cache_clear()


def test_a_kind_may_have_two_numbers_and_two_configurations(
    wide: tuple[ModuleType, ModuleType],
) -> None:
    """Neither of two floats, configurations or paths of a kind is lost."""
    check_round_trip(*wide, Kind.CONNECT)
    check_round_trip(*wide, Kind.EDGE)


@pytest.mark.parametrize("kind_of", ["int64", "uint32", "string"])
def test_a_field_that_does_not_fit_is_refused(kind_of: str) -> None:
    """By its name and its kind's, when the module is imported."""
    fields = (*FIELDS[Kind.EDGE], Field("weight", kind_of, "too large"))
    with pytest.raises(TypeError, match=f"field 'weight' of kind EDGE has the type '{kind_of}'"):
        event_columns.layout_of(Kind.EDGE, fields)


@pytest.mark.parametrize("kind", Kind)
def test_functions_are_declared_as_they_are_made(kind: Kind) -> None:
    """The type that mypy knows has as many arguments, of the same types."""
    declared, _ = get_args(emit.__annotations__[f"emit_{kind.key}"])
    types: dict[str, tuple[Any, ...]] = {"q": (emit.Floats, int), "q[]": (int, int)}
    types |= {"bool": (bool,), "uint8": (int,), "int32": (int,), "float64": (float,)}
    expected = [emit.Buffer, int]
    for field in FIELDS[kind]:
        expected += types[field.type]
    assert declared == expected
    if not config.DISABLE_JIT:
        names = getattr(emit, f"emit_{kind.key}").py_func.__code__
        assert names.co_argcount == len(expected)


def test_counts() -> None:
    """Every count has a name of its own, and what it is split by is a field."""
    keys = [count.key for count in COUNTS.values() if count.key]
    assert len(set(keys)) == len(keys)
    for kind, count in COUNTS.items():
        assert count.by is None or count.by in [field.name for field in FIELDS[kind]]
    assert COUNTS[Kind.EXPAND].text(1) == "1 cell expanded"
    assert COUNTS[Kind.EXPAND].text(1200) == "1,200 cells expanded"
