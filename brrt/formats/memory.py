"""Events kept in memory, for notebooks and tests."""

from brrt.events import Events


class Memory:
    """Keeps every batch."""

    def __init__(self) -> None:
        self.batches: list[Events] = []

    def write(self, events: Events) -> None:
        """Keep a batch."""
        self.batches.append(events)

    def close(self, *, whole: bool) -> None:
        """Nothing to release."""

    def events(self) -> Events:
        """Return the whole log.

        Raises:
            ValueError: Nothing was written.
        """
        if not self.batches:
            raise ValueError("nothing has been recorded")
        return Events.concat(self.batches[0].dof, self.batches)
