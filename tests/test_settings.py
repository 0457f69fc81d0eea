"""Settings are converted, checked and described."""

import math
from dataclasses import FrozenInstanceError, dataclass
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt.errors import BrrtError
from brrt.planners import PLANNERS
from brrt.planners.postprocessing.shortcut import Shortcut
from brrt.settings import Settings, param
from brrt.worlds import GENERATORS


@dataclass(frozen=True, slots=True)
class Sample(Settings):
    """One setting of each type."""

    count: int = param(3, "how many", low=0, high=10)
    size: float = param(1.5, "how large", above=0, unit="m")
    part: float = param(0.25, "which part", low=0, high=1)
    range: float | None = param(None, "how far; all by default", above=0)
    keep: bool = param(False, "whether to keep it")
    mode: Literal["slow", "fast"] = param("slow", "which way")


def test_defaults() -> None:
    """Without values the defaults are used."""
    assert Sample.parse("sample", {}) == Sample()
    assert Sample().as_dict() == {
        "count": 3, "size": 1.5, "part": 0.25, "range": None, "keep": False, "mode": "slow",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "given", "value"),
    [
        ("count", "7", 7),
        ("count", 7.0, 7),
        ("count", " 7 ", 7),
        ("size", "2.5", 2.5),
        ("size", 2, 2.0),
        ("size", "1e-3", 0.001),
        ("part", 0, 0.0),
        ("part", "1", 1.0),
        ("range", None, None),
        ("range", "auto", None),
        ("range", "", None),
        ("range", "4", 4.0),
        ("keep", "true", True),
        ("keep", "Yes", True),
        ("keep", "on", True),
        ("keep", 1, True),
        ("keep", "FALSE", False),
        ("keep", "0", False),
        ("mode", "fast", "fast"),
    ],
)
def test_values_are_brought_to_their_type(name: str, given: Any, value: Any) -> None:
    """Strings and similar types are converted to the declared type."""
    found = getattr(Sample.parse("sample", {name: given}), name)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("count", "many", "count must be a whole number, not 'many'"),
        ("count", "2.5", "count must be a whole number, not '2.5'"),
        ("count", 2.5, "count must be a whole number, not 2.5"),
        ("count", True, "count must be a whole number, not True"),
        ("count", None, "count must be a whole number, not None"),
        ("count", math.nan, "count must be a whole number, not nan"),
        ("count", math.inf, "count must be a whole number, not inf"),
        ("count", [1], "count must be a whole number"),
        ("count", -1, "count must be at least 0, not -1"),
        ("count", 11, "count must be at most 10, not 11"),
        ("count", 10**400, "count must be at most 10"),
        ("size", "wide", "size must be a number, not 'wide'"),
        ("size", True, "size must be a number, not True"),
        ("size", None, "size must be a number, not None"),
        ("size", 0, "size must be above 0, not 0"),
        ("size", -1.0, "size must be above 0, not -1"),
        ("size", "nan", "size must be a finite number, not nan"),
        ("size", "inf", "size must be a finite number, not inf"),
        ("size", 10**400, "size must be a number"),
        ("part", 1.5, "part must be at most 1, not 1.5"),
        ("part", -0.1, "part must be at least 0, not -0.1"),
        ("range", 0.0, "range must be above 0, not 0"),
        ("range", math.nan, "range must be a finite number, not nan"),
        ("range", "far", "range must be a number, not 'far'"),
        ("keep", "maybe", "keep must be true or false, not 'maybe'"),
        ("keep", 2, "keep must be true or false, not 2"),
        ("keep", None, "keep must be true or false, not None"),
        ("mode", "quick", "unknown value of mode 'quick'"),
        ("mode", "fats", "did you mean 'fast'?"),
        ("mode", None, "unknown value of mode 'None'"),
    ],
)
def test_errors_name_the_setting_and_the_value(name: str, given: Any, message: str) -> None:
    """Wrong values are refused in one line, both from Python and from strings."""
    with pytest.raises(BrrtError) as parsed:
        Sample.parse("sample", {name: given})
    with pytest.raises(BrrtError) as made:
        Sample(**{name: given})
    for error in (parsed, made):
        assert message in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("cuont", "did you mean 'count'?"),
        ("Size", "did you mean 'size'?"),
        ("zzz", "choose from: count, keep, mode, part, range, size"),
    ],
)
def test_unknown_names(name: str, hint: str) -> None:
    """An unknown setting is an error that names the nearest one."""
    with pytest.raises(BrrtError, match="unknown parameter of planner x") as error:
        Sample.parse("planner x", {name: 1})
    assert hint in str(error.value)


def test_settings_cannot_be_changed() -> None:
    """Settings are immutable and hashable."""
    settings = Sample()
    with pytest.raises(FrozenInstanceError):
        settings.count = 4  # type: ignore[misc]
    assert hash(settings) == hash(Sample())


def test_describe() -> None:
    """The table of settings has name, default, unit, range and meaning."""
    rows = {row["name"]: row for row in Sample.describe()}
    assert list(rows) == ["count", "size", "part", "range", "keep", "mode"]
    assert rows["count"] == {
        "name": "count", "default": "3", "unit": "", "range": ">= 0, <= 10", "doc": "how many",
    }  # fmt: skip
    assert (rows["size"]["default"], rows["size"]["unit"]) == ("1.5", "m")
    assert rows["size"]["range"] == "> 0"
    assert (rows["range"]["default"], rows["range"]["range"]) == ("auto", "> 0")
    assert (rows["keep"]["default"], rows["keep"]["range"]) == ("false", "true | false")
    assert (rows["mode"]["default"], rows["mode"]["range"]) == ("slow", "slow | fast")


ALL_SETTINGS = [*PLANNERS.values(), *GENERATORS.values(), Shortcut]


@pytest.mark.parametrize("settings", ALL_SETTINGS, ids=lambda cls: cls.__name__)
def test_every_description_is_complete_and_parses(settings: type[Settings]) -> None:
    """Each setting has a meaning, and each printed default can be parsed."""
    rows = settings.describe()
    assert all(row["doc"] and row["name"] for row in rows)
    printed = {row["name"]: row["default"] for row in rows}
    assert settings.parse("it", printed) == settings()
    assert settings.parse("it", settings().as_dict()) == settings()


@given(st.integers(0, 10), st.floats(1e-149, 1e149), st.booleans(), st.none() | st.floats(1e-9, 9))
def test_round_trips(count: int, size: float, keep: bool, far: float | None) -> None:
    """as_dict and parse are inverse, also through strings."""
    settings = Sample(count=count, size=size, keep=keep, range=far)
    assert Sample.parse("sample", settings.as_dict()) == settings
    texts = {name: "auto" if x is None else str(x) for name, x in settings.as_dict().items()}
    assert Sample.parse("sample", texts) == settings


@given(
    st.dictionaries(
        st.sampled_from(["count", "size", "range", "keep", "mode"]),
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    )
)
def test_any_value_is_used_or_refused(values: dict[str, Any]) -> None:
    """Any value gives settings in range or a BrrtError."""
    try:
        settings = Sample.parse("sample", values)
    except BrrtError:
        return
    assert 0 <= settings.count <= 10
    assert settings.size > 0
    assert settings.range is None or settings.range > 0
    assert settings.mode in ("slow", "fast")
