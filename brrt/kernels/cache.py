"""The cache of compiled kernels on disk: numba's, but any failure means compiling anew."""

# mypy: disable-error-code="no-untyped-call"

import os
import pickle
import secrets
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

from brrt.kernels.private_folder import fault_of_folder, make_private, read_private

_CHECKSUM_BYTES = 4

_notify: Callable[[str], None] | None = None


def on_unsaved(notify: Callable[[str], None]) -> None:
    """Call `notify` with the reason, once, when compiled code cannot be written to the cache."""
    global _notify  # noqa: PLW0603 - one cache, one listener
    _notify = notify


class _Locator(UserProvidedCacheLocator):
    """The folder `numba.config.CACHE_DIR`, which need not be there before something is saved.

    Only the user can write to it.
    """

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        return cls(py_func, py_file)

    def ensure_cache_path(self) -> None:
        folder = Path(self.get_cache_path())
        make_private(folder)
        fault = fault_of_folder(folder)
        if fault is not None:
            raise PermissionError(f"{folder}: {fault}")


class _Implementation(CompileResultCacheImpl):
    _locator_classes: list[type[object]] = [_Locator]  # noqa: RUF012 - numba declares it so


class KernelCache(FunctionCache):
    """The compiled versions of one function.

    Numba raises whatever opening, reading or unpickling a damaged file raises, and what writing to
    a full disk does.
    """

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature; None if it is not in the cache."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001 - unpickling raises nearly anything
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save a compiled function if that is possible."""
        global _notify
        try:
            super().save_overload(sig, data)
        except Exception as error:  # noqa: BLE001 - the function is compiled, saved or not
            notify, _notify = _notify, None
            if notify is not None:
                reason = getattr(error, "strerror", None) or error
                notify(f"{Path(self._cache_path).parent}: {reason}")


class _Files(IndexDataCacheFile):
    """The files of one function, with a checksum, and with the key that their code is for.

    A file of the right length may hold wrong bytes, zeros after a power cut, which the linker would
    crash on. Of two processes that save at once, one may overwrite what the other's index names. A
    link is not followed, and a pipe is not waited for.
    """

    def save(self, key: Any, data: Any) -> None:
        super().save(key, (self._label(key), data))

    def load(self, key: Any) -> Any:
        loaded = super().load(key)
        return loaded[1] if loaded and loaded[0] == self._label(key) else None

    def _label(self, key: Any) -> tuple[Any, ...]:
        return (self._index_name, self._source_stamp, key)

    def _load_index(self) -> Any:
        try:
            version, stamp, names = self._unpickle(self._index_path)
        except Exception:  # noqa: BLE001 - see KernelCache; the next save writes a new one
            return {}
        return names if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads: Any) -> None:
        data = self._dump((self._version, self._source_stamp, overloads))
        with self._open_for_write(self._index_path) as file:
            file.write(data)

    def _dump(self, obj: Any) -> bytes:
        data = super()._dump(obj)  # unpickling ignores what follows
        return bytes(data + zlib.crc32(data).to_bytes(_CHECKSUM_BYTES, "little"))

    def _load_data(self, name: str) -> Any:
        return self._unpickle(self._data_path(name))

    def _unpickle(self, path: str) -> Any:
        """Read what `_dump` has written.

        Raises:
            Exception: The folder or the file is not the user's own, or the file is damaged.
        """
        fault = fault_of_folder(self._cache_path)
        if fault is not None:
            raise PermissionError(f"{self._cache_path}: {fault}")
        data = read_private(path)
        end = len(data) - _CHECKSUM_BYTES
        if zlib.crc32(memoryview(data)[:end]).to_bytes(_CHECKSUM_BYTES, "little") != data[end:]:
            raise ValueError(f"{path}: damaged")
        return pickle.loads(data)  # noqa: S301 - as numba does, from the user's own folder

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[IO[bytes]]:
        """Open a file that replaces `filepath` once it is complete."""
        temporary = f"{filepath}.{secrets.token_hex(8)}"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        number = os.open(temporary, flags, 0o600)
        try:
            with open(number, "wb") as file:  # noqa: PTH123 - a descriptor
                yield file
            Path(temporary).replace(filepath)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
