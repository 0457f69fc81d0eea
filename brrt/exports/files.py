"""Tables as files: CSV, which needs nothing, and Parquet, which needs pyarrow."""

import csv
import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError
from brrt.exports.extras import need
from brrt.exports.tables import Columns, table_names

Write = Callable[[Columns, Path], None]


def write_csv(tables: Mapping[str, Columns], folder: Path, *, force: bool = False) -> None:
    """Write each table as a .csv file; numbers are read back bit for bit.

    Args:
        tables: The tables by name.
        folder: A new or empty folder, which appears once all files are complete.
        force: Replace an older export in it.

    Raises:
        BrrtError: The folder has other files, or cannot be written.
    """
    _write(tables, folder, ".csv", _write_csv, force=force)


def write_parquet(tables: Mapping[str, Columns], folder: Path, *, force: bool = False) -> None:
    """Write each table as a .parquet file; see `write_csv`.

    Raises:
        BrrtError: pyarrow is missing, the folder has other files, or cannot be written.
    """
    pyarrow, parquet = need("pyarrow"), need("pyarrow.parquet")

    def write(columns: Columns, path: Path) -> None:
        parquet.write_table(pyarrow.table(dict(columns)), path)

    _write(tables, folder, ".parquet", write, force=force)


def _write(
    tables: Mapping[str, Columns], folder: Path, suffix: str, write: Write, *, force: bool
) -> None:
    with _replacing(folder, suffix, force=force) as unfinished:
        for name, columns in tables.items():
            write(columns, unfinished / f"{name}{suffix}")


def _write_csv(columns: Columns, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*map(_values, columns.values()), strict=True))


def _values(column: Any) -> Any:
    """Return a column's values as csv writes them: floats by `repr`, which loses nothing."""
    values = column.tolist()
    return ["true" if value else "false" for value in values] if column.dtype == bool else values


def check_folder(folder: Path, suffix: str, *, force: bool) -> None:
    """Raise unless a folder is new, empty, or an older export that may be replaced.

    Raises:
        BrrtError: It has other files, or is no folder.
    """
    if not folder.parent.is_dir():
        raise BrrtError(f"{folder}: there is no folder {folder.parent}; make it first")
    if not folder.exists():
        return
    if not folder.is_dir():
        raise BrrtError(f"{folder}: is a file; name a folder")
    names = sorted(path.name for path in folder.iterdir())
    ours = {f"{name}{suffix}" for name in table_names()}
    if names and not force:
        raise BrrtError(f"{folder}: exists already; choose another name or add --force")
    others = [name for name in names if name not in ours]
    if others:
        raise BrrtError(f"{folder}: holds {others[0]}, which is no {suffix} file of an export")


@contextmanager
def _replacing(folder: Path, suffix: str, *, force: bool) -> Iterator[Path]:
    """Yield a temporary folder that gets the name once all files in it are complete."""
    check_folder(folder, suffix, force=force)
    folder = Path(os.path.realpath(folder))
    unfinished, old = (folder.with_name(f".brrt-{secrets.token_hex(8)}") for _ in range(2))
    try:
        unfinished.mkdir()
        yield unfinished
        check_folder(folder, suffix, force=force)  # it may have changed meanwhile
        if folder.exists() and any(folder.iterdir()):
            folder.rename(old)
        unfinished.rename(folder)
    except OSError as error:
        raise BrrtError(f"cannot write {folder}: {error.strerror or error}") from None
    finally:
        for each in (unfinished, old):
            shutil.rmtree(each, ignore_errors=True)
