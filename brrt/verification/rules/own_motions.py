"""The rule about planners whose motions are their own, of which a log has only the ends."""

import numpy as np

from brrt.events import Events, Kind, Table
from brrt.scenario.contract import Contract
from brrt.verification.context import waypoints
from brrt.verification.rule import Rule


class ConfigurationsFree(Rule):
    name = "configurations free"
    promise = "Where motions are own, nodes, cells and waypoints are free of obstacles."
    assumes = ("collisions",)

    def window(self, events: Events, contract: Contract) -> None:
        if self.context.claims.motions == "straight":
            return  # rules about motions judge their ends
        if self.context.claims.edges == "checked":
            for kind in (Kind.EDGE, Kind.VERTEX, Kind.EXPAND):
                self._judge(events[kind], kind.label)
        for event in events[Kind.PATH]:
            path = waypoints(event, self.context.dof)
            hit = self.context.first_hits(path, path)
            at = np.flatnonzero(hit >= 0)
            name = self.context.obstacles.name(int(hit[at[0]])) if len(at) else ""
            self.judge_one(event, f"waypoint {at[0]} is in {name}" if len(at) else None)

    def _judge(self, table: Table, what: str) -> None:
        q = np.asarray(table["q"])
        hit = self.context.first_hits(q, q)
        self.judge(
            table, hit >= 0, lambda i: f"{what} ends in {self.context.obstacles.name(int(hit[i]))}"
        )


RULES = (ConfigurationsFree,)
