"""Runs that branch off a recorded one: they continue it with other settings."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from os import PathLike
from typing import Any

from brrt.errors import BrrtError, unknown
from brrt.events import Events, Status
from brrt.planners import check_params, make_planner, make_stop, state_contract
from brrt.planners.base.kernel_planner import KernelPlanner, KernelRun
from brrt.planners.base.stop import Stop
from brrt.recording import Limits, Recording, check_limits
from brrt.runs.resume import (
    Continuation,
    RecordedRun,
    SharedEvents,
    end_of_planning,
    kernel_planner,
    name_of,
    restored,
)
from brrt.scenario.contracts import as_planned
from brrt.scenario.manifest import Branch, Manifest
from brrt.scenario.scenario import Scenario

_CHANGEABLE = ("iterations", "time", "smooth", "shortcuts", "execute", "max_move", "deadline")
"""Fields of the scenario that a branch may change, beside the planner's parameters."""


class BranchedRun(RecordedRun):
    """Continues a recorded run from an iteration with other settings; those not given stay.

    It plans again up to that iteration and compares every event with the recording. Its log begins
    with the recorded events, times included.

    Args:
        recording: What `brrt.read` or `Run.record` returns.
        params: Settings of the planner.
        seed: Seed of the draws after the branch; by default the generator continues.
        settings: Fields of the scenario: iterations and time, both counted from the start of the
            run; smooth, shortcuts, execute, max_move and deadline.
        batch: Events in a batch at most; the log does not depend on it.
        until: The instant, as `Events.until` takes it: `iteration`, `seq` or `t`. The branch is
            after the last iteration that was complete by then; by default at the end of planning.

    Raises:
        BrrtError: The recording cannot be continued there, a setting is wrong, or planning again
            differs from the recording.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        params: Mapping[str, Any] | None = None,
        seed: int | None = None,
        settings: Mapping[str, Any] | None = None,
        batch: int = 8192,
        **until: int,
    ) -> None:
        _check_recording(recording)
        check_limits(until, "params", "seed", "settings", "batch")
        iteration, ended = _branching_point(recording, until)
        before = recording.manifest.ruling(iteration)
        scenario = _changed(before, params or {}, seed, settings or {})
        then = as_planned(before, recording.world)[-1]
        values = {k: v for k, v in scenario.params.items() if v is not None or k in (params or {})}
        now = replace(scenario, params={**then.params, **values})
        planner, parent = kernel_planner(now), kernel_planner(then)
        _check_fixed(parent, planner)
        # If only what follows planning changes, the last iteration of planning is made again.
        after = ended is not None and seed is None and _plans_alike(before.scenario, scenario)
        if after and ended is Status.SOLVED and before.ruling(iteration - 1) == before:
            iteration -= 1
        else:
            _check_open(recording, iteration, ended, parent, planner)
        while True:
            super().__init__(recording, before, scenario, planner, batch)
            shared = SharedEvents(recording, iteration)
            run = restored(shared, before, self.problem, self._rng, self._log)
            if run is not None:
                break
            _check_unfinished(recording, iteration, ended, until)
            iteration, ended = iteration - 1, None
        if not after:
            _check_budget(recording, run, shared.t, self.stop)
        seed = None if seed is None else scenario.seed
        run.switch_settings(planner.kernel(self.problem, self.stop), seed)
        self._planner = Continuation(run, shared)
        here = Branch(
            parent=recording.manifest.digest(),
            file=recording.name,
            iteration=iteration,
            events=shared.count,
            scenario=before.scenario,
            seed=seed,
            contract=before.contract
            or state_contract(parent, self.problem, make_planner(before.scenario)),
        )
        # Times continue from the recorded ones, so time 0 lies that much earlier.
        epoch = self.manifest.epoch_ns - (0 if scenario.clock == "logical" else shared.t)
        branches = (*before.branches, here)
        self.manifest = replace(self.manifest, branches=branches, epoch_ns=max(epoch, 0))


def last_complete_iteration(batches: Iterable[Events], limits: Limits) -> tuple[int, Status | None]:
    """Find the last iteration of planning that was complete at an instant; -1 if none was.

    Args:
        batches: The events.
        limits: The instant; the end of planning if empty.

    Returns:
        The iteration, and how planning ended if it did right after it.
    """
    last = -1
    for batch in batches:
        end, status = end_of_planning(batch)
        inside = batch.until(seq=end)
        part = inside.until(**limits)
        if len(part):
            last = part.last.iteration
        if len(part) < len(inside):
            following = min(
                int(table["iteration"][len(part[kind])])
                for kind, table in inside.tables.items()
                if len(part[kind]) < len(table)
            )
            return (last if following > last else last - 1), None
        if status is not None:
            return last, status
    # The log is cut: its last iteration may have had more events.
    return last - 1, None


def _branching_point(recording: Recording, limits: Limits) -> tuple[int, Status | None]:
    """Find the iteration to branch after; raise if planning ended before the instant."""
    if not any(map(len, recording.batches())):
        raise BrrtError(f"{name_of(recording)}: it has no events to branch after")
    iteration, status = last_complete_iteration(recording.batches(), limits)
    if "iteration" in limits and limits["iteration"] > iteration:
        end = "it is cut after" if status is None else "planning ended with"
        raise BrrtError(
            f"{name_of(recording)}: {end} iteration {iteration:,}; branch there at the latest, and "
            "what follows planning is made anew"
        )
    return max(iteration, 0), status


def _check_recording(given: Any) -> None:
    """Raise unless `given` is a recording."""
    if isinstance(given, str | PathLike):
        path = str(given)
        raise BrrtError(f"a branch continues a recording: give brrt.read({path!r})")
    if not isinstance(given, Recording):
        kind = type(given).__name__
        raise BrrtError(f"a branch continues a brrt.Recording, as brrt.read returns, not {kind}")


def _check_open(
    recording: Recording,
    iteration: int,
    ended: Status | None,
    before: KernelPlanner,
    now: KernelPlanner,
) -> None:
    """Raise if planning cannot continue after an iteration that it `ended` with.

    That is so if the run ended with a path and the new settings stop there too, or with the proof
    that there is no path.
    """
    if ended is Status.SOLVED and now.ends_like(before):
        remedy = f", or {now.resume_hint}" if now.resume_hint else ""
        outcome = "its path"
    elif ended is Status.NO_PATH:
        remedy, outcome = "", "the proof that there is no path"
    else:
        return
    raise BrrtError(
        f"{name_of(recording)}: the run ended with {outcome} at iteration {iteration:,}; branch "
        f"before that (--at-iteration){remedy}"
    )


def _check_unfinished(
    recording: Recording, iteration: int, ended: Status | None, limits: Limits
) -> None:
    """Raise unless a run that ended within an iteration may continue after the one before.

    Raises:
        BrrtError: The iteration was asked for or is the first one, or neither the clock nor an
            interruption ended it, so that the recording is damaged.
    """
    place = f"{name_of(recording)}: planning ended within iteration {iteration:,}"
    if ended not in (Status.TIME_LIMIT, Status.INTERRUPTED):
        raise BrrtError(f"{place}, which only the clock or an interruption can do")
    if iteration == 0:
        raise BrrtError(f"{place}; there is none to branch after, so plan from the start")
    if "iteration" in limits:
        raise BrrtError(f"{place}; branch after iteration {iteration - 1:,} at the latest")


def _check_budget(recording: Recording, run: KernelRun, t: int, stop: Stop) -> None:
    """Raise if the budget, which counts from the start of the run, is used up."""
    due = stop.reached(run.counted, t / 1e9)
    if due is Status.TIME_LIMIT:
        spent = f"{t / 1e9:.6g} s have passed of {stop.time_s:g}; give more by --time"
    elif due is not None or (stop.draws is not None and run.drawn >= stop.draws):
        most = min(stop.iterations, stop.iterations if stop.draws is None else stop.draws)
        spent = f"{run.counted:,} of {most:,} iterations are made; give more by --iterations"
    else:
        return
    raise BrrtError(f"{name_of(recording)}: at the branch {spent}, counted from the run's start")


def _changed(
    manifest: Manifest, params: Mapping[str, Any], seed: int | None, settings: Mapping[str, Any]
) -> Scenario:
    """Return the scenario of a run with other settings; those not given stay."""
    for name in settings:
        if name in _CHANGEABLE:
            continue
        if name in (f.name for f in fields(Scenario)):
            raise BrrtError(f"a branch keeps the {name} of its recording; leave out {name}")
        raise unknown("setting of a branch", name, _CHANGEABLE)
    scenario = manifest.scenario
    values = {**scenario.as_dict(), **settings, "params": {**scenario.params, **params}}
    if "iterations" in settings:
        values["draws"] = None
    if seed is not None:
        values["seed"] = seed
    # A random start or goal was drawn from the first seed.
    for name in ("start", "goal"):
        if isinstance(values[name], str):
            values[name] = getattr(manifest, name)
    return check_params(Scenario.parse(values))


def _plans_alike(before: Scenario, now: Scenario) -> bool:
    """Whether two scenarios differ, but in nothing that affects planning."""
    same = make_planner(before) == make_planner(now) and make_stop(before) == make_stop(now)
    return same and before != now


def _check_fixed(before: KernelPlanner, now: KernelPlanner) -> None:
    """Raise if a setting differs that is fixed from the start of a run."""
    for name in now.fixed_params:
        then, wanted = getattr(before, name), getattr(now, name)
        if wanted != then:
            raise BrrtError(
                f"{name} cannot change to {wanted} at a branch: the lattice is laid at the start, "
                f"with {name} {then}; leave it out, or plan from the start"
            )
