"""`brrt replay`: the metrics that plan printed, instants, cut files, and --check."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Result

Command = Callable[..., Result]
CONTRACT = (
    "planner world robot seed solved status iterations events samples rejects nodes edges rewires "
    "path_cost path smoothed_cost smoothed_path plan_time_s smooth_time_s moves max_move_time_s "
    "deadline_misses"
).split()
RUNS: tuple[list[str], ...] = (
    [],
    ["--planner", "rrt-star", "--iterations", "300"],
    ["--planner", "rrt-connect", "--execute", "--deadline", "0.001"],
    ["--planner", "lrta-star", "--world", "circles2d:n=10"],
    ["--iterations", "20"],
)


@pytest.mark.parametrize("options", RUNS, ids=" ".join)
def test_metrics_equal_those_of_plan(options: list[str], brrt: Command) -> None:
    """Key for key, from either file, with the real clock; from a branch too."""
    planned = brrt("plan", *options, "--json", "--out", "a.mcap", "--rrd", "a.rrd").json
    assert set(CONTRACT) <= set(planned)
    assert brrt("replay", "a.mcap", "--json").json == planned
    assert brrt("replay", "a.rrd", "--json").json == planned
    assert brrt("replay", "a.mcap", "--rrd", "b.rrd").code == 0
    assert brrt("replay", "b.rrd", "--json").json == planned
    branch = brrt("plan", "--from", "a.mcap", "--at-iteration", 1, "--seed", 9, "--json")
    assert branch.code in (0, 1), branch.err
    assert brrt("replay", "branch.mcap", "--json").json == branch.json


def test_check(brrt: Command) -> None:
    """Two runs with one seed are equal event by event; another seed is not."""
    for name, seed in (("a", 7), ("b", 7), ("c", 8)):
        assert brrt("plan", "--seed", seed, "--out", f"{name}.mcap").code == 0
    equal, parted = (brrt("replay", "a.mcap", "--check", f"{x}.mcap") for x in "bc")
    assert (equal.code, parted.code) == (0, 1)
    assert "a.mcap (seed 7) and b.mcap (seed 7) are equal" in equal.out
    heading = (
        "A  a.mcap (seed 7)\nB  c.mcap (seed 8)\nThe first difference is event 2; before it:\n"
    )
    assert heading in parted.out
    assert all(len(line) <= 80 for line in parted.out.partition(heading)[2].splitlines())
    assert brrt("replay", "a.mcap", "--check", "c.mcap", "--json").json["check"]["equal"] is False


def test_instants(brrt: Command) -> None:
    """The three ways to name an instant agree with each other."""
    brrt("plan", "--out", "a.mcap", "--clock", "logical")
    at_event = brrt("replay", "a.mcap", "--at-event", 100, "--json").json
    assert at_event["events"] == 101
    assert at_event["status"] == "running"
    assert brrt("replay", "a.mcap", "--at", "100us", "--json").json == at_event
    assert brrt("replay", "a.mcap", "--at", "0.1ms", "--json").json == at_event
    assert brrt("replay", "a.mcap", "--at-iteration", 30, "--json").json["samples"] == 30
    assert brrt("replay", "a.mcap", "--at", "1h").code == 2
    assert brrt("replay", "a.mcap", "--at", "1s", "--at-event", 3).code == 2


@pytest.mark.parametrize(
    ("option", "beyond", "message"),
    [
        ("--at", "1s", "the recording ends at 0.00"),
        ("--at-event", 10**9, "the recording ends with event "),
        ("--at-iteration", 10**9, "the recording ends with iteration "),
    ],
)
def test_instants_beyond_the_end(option: str, beyond: object, message: str, brrt: Command) -> None:
    """After the last event, one line on stderr and the metrics of the end."""
    planned = brrt("plan", "--out", "a.mcap", "--clock", "logical", "--json").json
    done = brrt("replay", "a.mcap", option, beyond, "--json")
    assert (done.code, done.json) == (0, planned)
    assert message in done.err
    assert done.err.count("\n") == 1
    last = planned["events"] - 1
    for name, value in (("--at", f"{last}us"), ("--at-event", last),
                        ("--at-iteration", planned["iterations"])):  # fmt: skip
        end = brrt("replay", "a.mcap", name, value, "--json")
        assert (end.json, end.err) == (planned, "")


def test_cut_and_foreign_files(brrt: Command) -> None:
    """A cut file is replayed with one line on stderr; with --check it needs --partial."""
    brrt("plan", "--out", "a.mcap", "--iterations", 30_000, "--param", "goal_bias=0",
         "--param", "step=0.02")  # fmt: skip
    whole = Path("a.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    for options in ([], ["--partial"]):
        done = brrt("replay", "cut.mcap", "--json", *options)
        assert (done.code, done.err.count("\n")) == (0, 1)
        assert "is cut at byte" in done.err
        assert "the end of the run is missing" in done.err
        assert done.json["status"] == "running"
        assert 0 < done.json["events"] < 60_003
    for options in (["cut.mcap", "--check", "a.mcap"], ["a.mcap", "--check", "cut.mcap"]):
        done = brrt("replay", *options)
        assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
        assert "with --partial, or save them with brrt recover cut.mcap" in done.err
        assert brrt("replay", *options, "--partial").code == 1
    for name, text in (("a.txt", "hello"), ("b.mcap", "hello"), ("c.rrd", "RRF2hello")):
        Path(name).write_text(text)
        assert brrt("replay", name).code == 2
    assert "No such file" in brrt("replay", "none.mcap").err


def test_outcome_before_the_end(brrt: Command) -> None:
    """A run that is cut, or replayed up to an instant, has not failed; the JSON says running."""
    brrt("plan", "--planner", "rrt-star", "--iterations", "2000", "--out", "a.mcap")
    assert "solved, ended by: iteration limit" in brrt("replay", "a.mcap").out
    early = brrt("replay", "a.mcap", "--at-iteration", "3")
    assert "outcome  not solved yet, still planning at this point" in early.out
    late = brrt("replay", "a.mcap", "--at-iteration", "1990")
    assert "solved, still planning at this point" in late.out
    assert brrt("replay", "a.mcap", "--at-iteration", "3", "--json").json["status"] == "running"
    whole = Path("a.mcap").read_bytes()
    Path("b.mcap").write_bytes(whole[: len(whole) // 20])
    cut = brrt("replay", "b.mcap")
    assert cut.code == 0
    assert "not solved yet, still planning at this point" in cut.out
