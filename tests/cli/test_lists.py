"""`brrt planners`, `brrt robots`, `brrt worlds list`."""

from collections.abc import Callable

import pytest

from tests.conftest import Result

Command = Callable[..., Result]


@pytest.mark.parametrize("name", ["planners", "robots", "worlds"])
def test_lists(name: str, brrt: Command) -> None:
    """Each list is a table for people and an object for programs."""
    text, data = brrt(name), brrt(name, "--json")
    assert text.code == data.code == 0
    for entry in data.json:
        assert entry in text.out


@pytest.mark.parametrize("name", ["planners", "robots", "worlds list"])
def test_lists_show_one_alone(name: str, brrt: Command) -> None:
    """A name after the list's picks one; a wrong one is named, with the nearest."""
    every = brrt(*name.split(), "--json").json
    one = min(every)
    assert brrt(*name.split(), one, "--json").json == {one: every[one]}
    wrong = brrt(*name.split(), one + "x")
    assert wrong.code == 2
    assert f"did you mean {one!r}?" in wrong.err
