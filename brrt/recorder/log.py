"""`brrt.log`: record from inside a library, wherever a recording is open.

    import brrt

    brrt.log.edge(q, parent)  # nothing happens unless somebody has called brrt.record

The recording that was opened last gets the events, from all threads: a context variable would be
lost where a generator yields inside `with`, and in threads of the planner.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from brrt.recorder.recorder import Recorder

_open: list[Recorder] = []


class Log:
    """Methods of `Recorder` that do nothing, and return None, while no recording is open.

    Attributes:
        recordings: How many recordings this process has opened.
    """

    recordings = 0

    @property
    def recorder(self) -> Recorder | None:
        """The recording that was opened last; None if none is open."""
        return _open[-1] if _open else None

    def sample(self, *given: Any, **named: Any) -> None:
        """See `Recorder.sample`."""
        if _open:
            _open[-1].sample(*given, **named)

    def edge(self, *given: Any, **named: Any) -> int | None:
        """See `Recorder.edge`."""
        return _open[-1].edge(*given, **named) if _open else None

    def reject(self, *given: Any, **named: Any) -> None:
        """See `Recorder.reject`."""
        if _open:
            _open[-1].reject(*given, **named)

    def rewire(self, *given: Any, **named: Any) -> None:
        """See `Recorder.rewire`."""
        if _open:
            _open[-1].rewire(*given, **named)

    def connect(self, *given: Any, **named: Any) -> None:
        """See `Recorder.connect`."""
        if _open:
            _open[-1].connect(*given, **named)

    def path(self, *given: Any, **named: Any) -> None:
        """See `Recorder.path`."""
        if _open:
            _open[-1].path(*given, **named)

    def vertex(self, *given: Any, **named: Any) -> int | None:
        """See `Recorder.vertex`."""
        return _open[-1].vertex(*given, **named) if _open else None

    def link(self, *given: Any, **named: Any) -> None:
        """See `Recorder.link`."""
        if _open:
            _open[-1].link(*given, **named)

    def cut(self, *given: Any, **named: Any) -> None:
        """See `Recorder.cut`."""
        if _open:
            _open[-1].cut(*given, **named)

    def remove(self, *given: Any, **named: Any) -> None:
        """See `Recorder.remove`."""
        if _open:
            _open[-1].remove(*given, **named)

    def check(self, *given: Any, **named: Any) -> None:
        """See `Recorder.check`."""
        if _open:
            _open[-1].check(*given, **named)


log = Log()


def opened(recorder: Recorder) -> None:
    """Let the log write to a recorder."""
    _open.append(recorder)
    log.recordings += 1


def closed(recorder: Recorder) -> None:
    """Let the log write to the one that was opened before."""
    if recorder in _open:
        _open.remove(recorder)
