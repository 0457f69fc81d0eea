"""The cache of compiled kernels: whatever happens to its files, kernels compile and run."""

import os
import pickle
import shutil
import zlib
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


class Bomb:
    """Unpickling it makes a folder."""

    def __init__(self, made: Path) -> None:
        self._made = made

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self._made),)


def plant(file: Path, made: Path) -> None:
    """Write a file of the cache that runs code, with a right checksum."""
    data = pickle.dumps(Bomb(made))
    file.write_bytes(data + zlib.crc32(data).to_bytes(4, "little"))


@pytest.mark.parametrize("which", [0, 1], ids=["index", "code"])
@pytest.mark.parametrize("place", ["file", "folder"])
def test_what_others_may_write_to_is_not_unpickled(
    folder: Path, tmp_path: Path, which: int, place: str
) -> None:
    """Neither a file nor a folder; the payload would run in the file of a private folder."""
    file = files(folder)[which]
    plant(file, tmp_path / "own")
    hits(double)
    assert (tmp_path / "own").exists()
    plant(file, tmp_path / "boom")
    (file if place == "file" else file.parent).chmod(0o777)
    assert hits(double) == 0
    assert not (tmp_path / "boom").exists()
    assert hits(double) == (place == "file")  # a file is replaced, a folder stays unused


@pytest.mark.parametrize("which", [0, 1], ids=["index", "code"])
@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_links_and_pipes_are_replaced(folder: Path, tmp_path: Path, which: int, kind: str) -> None:
    """A link is not followed, not even to a good file, and a pipe is not waited for."""
    file = files(folder)[which]
    file.rename(tmp_path / "good")
    if kind == "link":
        file.symlink_to(tmp_path / "good")
    else:
        os.mkfifo(file)
    hits(double)
    assert hits(double) == 1
    assert file.is_file()
    assert not file.is_symlink()


def test_what_is_made_is_private(folder: Path) -> None:
    """Whatever the umask is."""
    modes = {path.stat().st_mode & 0o777 for path in [folder, *folder.rglob("*")]}
    assert modes == {0o700, 0o600}


def _to_pipe(root: Path) -> None:
    shutil.rmtree(root)
    os.mkfifo(root)


FAULTS: dict[str, Callable[[Path], object]] = {
    "writable": lambda root: root.chmod(0o777),
    "writable inside": lambda root: (root / "kernels").chmod(0o720),
    "a link": lambda root: root.symlink_to(root.rename(root.with_name("other"))),
    "a pipe": _to_pipe,
    "another's": lambda root: os.chown(root, 12345, -1),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_folders_that_are_not_used(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reason names the folder."""
    if fault == "another's" and os.geteuid():
        pytest.skip("only root gives files away")
    root = tmp_path / "cache"
    monkeypatch.setenv("BRRT_CACHE_DIR", str(root))
    assert jit._cache_folder()[0] is not None
    FAULTS[fault](root)
    found, reason = jit._cache_folder()
    assert found is None
    assert reason.startswith(str(root))
    assert "is not used" in reason


def test_folder_in_a_shared_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in /tmp, where others cannot remove it."""
    if os.geteuid():
        pytest.skip("such a folder belongs to root")
    tmp_path.chmod(0o1777)
    monkeypatch.setenv("BRRT_CACHE_DIR", str(tmp_path))
    assert jit._cache_folder()[0] is not None
