"""RRT and RRT* as classes, in the style of many lecture scripts; nothing here knows of brrt.

python examples/rrt_classes.py                 # plans, and prints the path's length
brrt record examples/rrt_classes.py --star     # the same, recorded

Edges are checked at points `resolution` apart, so some of them cut corners: brrt verify finds them.
"""

import argparse
import math
import random

OBSTACLES = [(5, 5, 1.0), (3, 7, 1.4), (7, 3, 1.4), (8, 8, 0.8), (5, 9, 0.5), (2, 3, 0.5)]


class RRT:
    """One tree from the start."""

    class Node:
        """A place in the plane, and where it was reached from."""

        def __init__(self, x, y):
            self.x, self.y, self.parent = x, y, None
            self.path_x, self.path_y = [], []

    def __init__(self, start, goal, obstacle_list, rand_area, robot_radius=0.0, max_iter=500):
        self.start, self.end = self.Node(*start), self.Node(*goal)
        self.min_rand, self.max_rand = rand_area
        self.obstacle_list, self.robot_radius = obstacle_list, robot_radius
        self.expand_dis, self.resolution, self.goal_rate = 1.5, 0.75, 0.1
        self.max_iter, self.node_list = max_iter, []

    def planning(self):
        """Return the path from the goal back to the start, or None."""
        self.node_list = [self.start]
        for _ in range(self.max_iter):
            drawn = self.get_random_node()
            near = self.node_list[self.get_nearest_node_index(self.node_list, drawn)]
            new = self.steer(near, drawn, self.expand_dis)
            if not self.is_free(new):
                continue
            self.node_list.append(new)
            last = self.steer(new, self.end)
            if math.dist((new.x, new.y), (self.end.x, self.end.y)) <= self.expand_dis and (
                self.is_free(last)
            ):
                return self.way_back(new)
        return None

    def get_random_node(self):
        """Draw a place, or the goal now and then."""
        if random.random() < self.goal_rate:
            return self.Node(self.end.x, self.end.y)
        low, high = self.min_rand, self.max_rand
        return self.Node(random.uniform(low, high), random.uniform(low, high))

    @staticmethod
    def get_nearest_node_index(node_list, drawn):
        """Find the nearest node."""
        far = [(node.x - drawn.x) ** 2 + (node.y - drawn.y) ** 2 for node in node_list]
        return far.index(min(far))

    def steer(self, from_node, to_node, most=math.inf):
        """Go straight from a node towards another, in steps of the resolution."""
        far = math.dist((from_node.x, from_node.y), (to_node.x, to_node.y))
        part = min(1.0, most / far) if far else 1.0
        x = from_node.x + part * (to_node.x - from_node.x)
        y = from_node.y + part * (to_node.y - from_node.y)
        new = self.Node(to_node.x, to_node.y) if part == 1.0 else self.Node(x, y)
        steps = max(1, math.floor(part * far / self.resolution))
        new.path_x = [from_node.x + i / steps * (new.x - from_node.x) for i in range(steps + 1)]
        new.path_y = [from_node.y + i / steps * (new.y - from_node.y) for i in range(steps + 1)]
        new.parent = from_node
        return new

    def is_free(self, node):
        """Whether the way to a node is free."""
        return self.check_collision(node, self.obstacle_list, self.robot_radius)

    @staticmethod
    def check_collision(node, obstacle_list, robot_radius):
        """Whether the points on the way to a node are free."""
        return all(
            math.dist((x, y), (ox, oy)) > size + robot_radius
            for ox, oy, size in obstacle_list
            for x, y in zip(node.path_x, node.path_y)
        )

    def way_back(self, node):
        """List the places from the goal back to the start."""
        path = [[self.end.x, self.end.y]]
        while node is not None:
            path.append([node.x, node.y])
            node = node.parent
        return path


class RRTStar(RRT):
    """RRT that goes on, and gives nodes better parents."""

    def planning(self):
        """Return the best path after all iterations, or None."""
        self.node_list = [self.start]
        self.start.cost = 0.0
        for _ in range(self.max_iter):
            drawn = self.get_random_node()
            near = self.node_list[self.get_nearest_node_index(self.node_list, drawn)]
            new = self.steer(near, drawn, self.expand_dis)
            if not self.is_free(new):
                continue
            around = [node for node in self.node_list if self.length(node, new) < 2.0]
            tried = [self.steer(node, new) for node in around] or [new]
            free = [t for t in tried if self.is_free(t)] or [new]
            for each in free:
                each.cost = each.parent.cost + self.length(each.parent, each)
            new = min(free, key=lambda node: node.cost)
            self.node_list.append(new)
            self.rewire(new, around)
        ends = [node for node in self.node_list if self.length(node, self.end) <= self.expand_dis]
        last = [node for node in ends if self.is_free(self.steer(node, self.end))]
        best = min(last, key=lambda node: node.cost + self.length(node, self.end), default=None)
        return None if best is None else self.way_back(best)

    def rewire(self, new, around):
        """Make the new node the parent of those that it is a shorter way to."""
        for node in around:
            edge = self.steer(new, node)
            cost = new.cost + self.length(new, node)
            if cost < node.cost and self.is_free(edge):
                node.parent, node.cost = new, cost
                node.path_x, node.path_y = edge.path_x, edge.path_y
                self.pass_on(node)

    def pass_on(self, parent):
        """Update the costs of what descends from a node."""
        for node in self.node_list:
            if node.parent is parent:
                node.cost = parent.cost + self.length(parent, node)
                self.pass_on(node)

    @staticmethod
    def length(a, b):
        """Distance of two nodes."""
        return math.dist((a.x, a.y), (b.x, b.y))


def main():
    """Plan once, or several times."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--star", action="store_true", help="RRT* instead of RRT")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--solves", type=int, default=1)
    args = parser.parse_args()
    random.seed(args.seed)
    for _ in range(args.solves):
        planner = (RRTStar if args.star else RRT)(
            start=[0, 0],
            goal=[9, 10],
            obstacle_list=OBSTACLES,
            rand_area=[-1, 11],
            robot_radius=0.2,
        )
        path = planner.planning()
        length = sum(map(math.dist, path, path[1:])) if path else math.nan
        print(f"{len(planner.node_list)} nodes, a path of {length:.3f}" if path else "no path")


if __name__ == "__main__":
    main()
