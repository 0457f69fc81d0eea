"""The cache of compiled kernels: whatever happens to its files, kernels compile and run."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from brrt.kernels import jit
from brrt.kernels.cache import on_unsaved
from brrt.kernels.jit import config, kernel

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


def double(x: int) -> int:
    """Twice a number."""
    return 2 * x


def triple(x: int) -> int:
    """Three times a number."""
    return 3 * x


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a cache that holds `double`."""
    monkeypatch.setattr(jit, "CACHE_FOLDER", tmp_path / "cache")
    assert hits(double) == 0
    assert hits(double) == 1
    return tmp_path / "cache"


def hits(function: Callable[[int], int]) -> int:
    """Compile or load a function, check it, and return how many versions the cache held."""
    compiled: Any = kernel(function)
    assert compiled(21) == function(21)
    return sum(compiled.stats.cache_hits.values())


def files(folder: Path) -> list[Path]:
    """The index and the code of `double`."""
    return [next(folder.rglob("*.nbi")), next(folder.rglob("*.nbc"))]


def zeroed(data: bytes) -> bytes:
    """Bytes with a hole, as a power cut leaves them."""
    third = len(data) // 3
    return data[:third] + bytes(third) + data[2 * third :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "cut": lambda data: data[: len(data) // 2],
    "one byte short": lambda data: data[:-1],
    "noise": lambda data: bytes(17 * i % 251 for i in range(len(data))),
    "zeroed": zeroed,
    "a flipped bit": lambda data: data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 1])
    + data[len(data) // 2 + 1 :],
}  # fmt: skip


@pytest.mark.parametrize("which", [0, 1], ids=["index", "code"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_are_replaced(folder: Path, which: int, damage: str) -> None:
    """The kernel is compiled anew, and the next process finds it in the cache again."""
    file = files(folder)[which]
    file.write_bytes(DAMAGES[damage](file.read_bytes()))
    hits(double)
    assert hits(double) == 1


@pytest.mark.parametrize("which", [0, 1], ids=["index", "code"])
def test_files_that_cannot_be_read_or_replaced(folder: Path, which: int) -> None:
    """A folder of the file's name stands for all that open refuses, even for root."""
    file = files(folder)[which]
    file.unlink()
    file.mkdir()
    reasons: list[str] = []
    on_unsaved(reasons.append)
    for _ in range(2):
        assert hits(double) == 0
    assert reasons == [f"{folder}: Is a directory"]


def test_removed_folder_is_made_again(folder: Path) -> None:
    """After the module is imported, and before the kernel is compiled."""
    compiled: Any = kernel(double)
    shutil.rmtree(folder)
    assert compiled(21) == 42
    assert hits(double) == 1


def test_folder_that_cannot_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reason is reported once."""
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(jit, "CACHE_FOLDER", tmp_path / "file" / "cache")
    reasons: list[str] = []
    on_unsaved(reasons.append)
    for _ in range(2):
        assert hits(double) == 0
    assert reasons == [f"{tmp_path / 'file' / 'cache'}: Not a directory"]


def test_code_of_another_kernel_is_not_loaded(folder: Path) -> None:
    """Two processes that save at once may leave an index that names the other's code."""
    code = files(folder)[1]
    hits(triple)
    other = next(file for file in folder.rglob("*triple*.nbc"))
    code.write_bytes(other.read_bytes())
    assert hits(double) == 0
    assert hits(double) == 1
