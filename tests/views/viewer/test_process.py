"""Live runs and worlds share one window."""

import os
import signal
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from rerun.experimental import ViewerClient

from brrt import RecordingError
from brrt.views.viewer import process
from tests.conftest import Result
from tests.support.web import ports_of


@contextmanager
def window(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Replace the viewer's window by a headless viewer, and end it after the body."""
    program, began = process.program(), folder / "began"
    assert program is not None
    hidden = folder / "hidden"
    hidden.write_text(
        f"#!/bin/sh\necho $$ >> {began}\necho noise\n"
        f'exec {program} --headless --window-size=1000x700 "$@"\n'
    )
    hidden.chmod(0o755)
    monkeypatch.setenv("DISPLAY", ":nowhere")
    monkeypatch.setattr(process, "PORT", process.free_port())
    monkeypatch.setattr(process, "program", lambda: str(hidden))
    try:
        yield
    finally:
        for number in began.read_text().split() if began.exists() else ():
            os.kill(int(number), signal.SIGTERM)


@pytest.mark.slow
@pytest.mark.usefixtures("viewer")
def test_runs_share_a_window(
    brrt: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A world, a run in 2D and one in 3D have their own layouts in one window.

    The window listens on this machine only, and its output is not shown.
    """
    psutil = pytest.importorskip("psutil")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with window(tmp_path, monkeypatch):
        for args in (
            ["worlds", "show", "circles2d:n=20,seed=2", "--view"],
            ["plan", "--world", "circles2d:n=20,seed=2", "--no-record", "--view", "--json"],
            ["plan", "--world", "boxes3d:n=60", "--no-record", "--view", "--json"],
        ):
            result = brrt(*args)
            assert (result.code, "noise" in result.out + result.err) == (0, False), result.err
        (number,) = (tmp_path / "began").read_text().split()
        assert set(ports_of(psutil.Process(int(number))).values()) == {"127.0.0.1"}
        client = ViewerClient.connect(process.address())
        names = {each.store_id.split(":")[1] for each in client.get_state().recordings}
        assert names == {"brrt 2d world 100 x 100", "brrt 2d 100 x 100", "brrt 3d 100 x 100 x 100"}


def test_no_viewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A viewer that is not there, or does not start, is an error of one line."""
    monkeypatch.setattr(process, "PORT", process.free_port())
    dying = tmp_path / "dying"
    dying.write_text("#!/bin/sh\necho one; echo 'no screen' >&2; exit 3\n")
    dying.chmod(0o755)
    for program, message in (
        (None, "there is no Rerun viewer; pip install rerun-sdk brings it"),
        (dying, "the Rerun viewer ended: no screen"),
    ):
        monkeypatch.setattr(process, "program", lambda found=program: found)
        with pytest.raises(RecordingError) as error:
            process.open_viewer()
        assert str(error.value) == message


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.0 505 No\r\n\r\n"])
def test_no_viewer_but_something_else(answer: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another program at the viewer's port is an error, not a wait for ever."""
    monkeypatch.setattr(process, "_HELLO_S", 0.2)
    with socket.create_server((process.HERE, 0)) as server:
        monkeypatch.setattr(process, "PORT", server.getsockname()[1])
        if answer:
            threading.Thread(target=_answer, args=(server, answer), daemon=True).start()
        with pytest.raises(
            RecordingError, match=f"the program at port {process.PORT} is not a Rer"
        ):
            process.open_viewer()


def _answer(server: socket.socket, answer: bytes) -> None:
    with ExitStack() as held:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            held.enter_context(connection).sendall(answer)
