"""A corrupted world file is read, or refused in one line."""

from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import BrrtError
from brrt.worlds import World, load_world
from tests.support.world_files import GOOD, corrupted, write


@pytest.mark.parametrize("name", GOOD)
@settings(max_examples=150)
@given(rng=st.randoms(use_true_random=False))
def test_corrupted_files(name: str, rng: Random, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Bytes, words and lines are changed, removed or inserted in files of every format."""
    folder = tmp_path_factory.getbasetemp() / "corrupted"
    if not folder.exists():
        folder.mkdir()
        write(folder)
    path = Path(folder, f"{Path(name).stem}.corrupted{Path(name).suffix}")
    path.write_bytes(corrupted((folder / name).read_bytes(), rng))
    query = "0" if name.startswith(("grid.scen", "circle_queries")) else ""
    try:
        world = load_world(
            path, {"obstacles": "circle_obstacles.txt"} if "queries" in name else {}, query
        )
    except BrrtError as error:
        message = str(error)
        assert message.startswith(str(path))
        assert message.isprintable()
        assert len(message) < len(str(path)) * 2 + 400
    else:
        assert isinstance(world, World)
