"""Runs of one method on one instance, with their CPU time.

A busy machine hardly changes CPU times; limits are CPU times, too. The referee checks plan and
bound after the clock has stopped. A `Run` has its own process with one thread; imports, first
solves of tiny instances, and coverage do not count.
"""

import math
import multiprocessing
import os
import resource
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.connection import Connection, wait
from threading import Thread
from time import process_time
from typing import Any, NamedTuple, Self

from cocap_opt.console.streams import say
from cocap_opt.console.threads import ONE_THREAD
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.result import BoundMethod, Report, Snapshot, silent
from cocap_opt.method import START_AND_REPORT, Method
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.run.engine import BOUND_METHOD, SOLVERS, run
from cocap_opt.run.judged import Judged
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, Stop, TimeLimit, never

_WARM_UP_SECONDS = 5.0
_MOST_MORE_SECONDS = 900.0  # for coverage, and for methods that are slow to notice a limit
BYTES = 1 if sys.platform == "darwin" else 1024  # unit of ru_maxrss
_ONE_THREAD = {**ONE_THREAD, "RAYON_NUM_THREADS": "1"}

Build = Callable[[], Problem]  # can be pickled, as it is sent to another process
# A registered method's name, the record of another method, or the function of a bound.
Measurable = str | Method[Any] | BoundMethod


class TimedRun(NamedTuple):
    """A judged result, with the time and memory that the method needed.

    Attributes
    ----------
    seconds : CPU time, including processes that the method started
    gigabytes : peak memory of the process, including imports and coverage
    """

    judged: Judged[Any]
    seconds: float
    gigabytes: float

    @classmethod
    def of(
        cls,
        problem: Problem,
        method: Measurable,
        stop: Stop = never,
        *,
        name: str = "",
        report: Report = silent,
    ) -> Self:
        """Runs a method with the engine; the clock stops before the referee starts.

        Parameters
        ----------
        name : name of a method that is not registered, for messages
        """
        record = _record(method)
        function, taken = record.function, list[tuple[float, float]]()
        begin = processor_seconds()

        def clocked(*arguments: Any, **options: Any) -> Result:
            found: Result = function(*arguments, **options)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * BYTES / 1e9
            taken.append((processor_seconds() - begin, peak))
            return found

        name = name or (method if isinstance(method, str) else record.__name__)
        judged = run(problem, replace(record, call=clocked), stop, name=name, report=report)
        return cls(judged, *taken[0])


def _record(method: Measurable) -> Method[Any]:
    if isinstance(method, str):
        return {**BOUNDS, **SOLVERS}[method]
    return method if isinstance(method, Method) else Method(method, takes=START_AND_REPORT)


def processor_seconds() -> float:
    """Returns the CPU time of this process and of child processes that have ended."""
    return process_time() + childrens_seconds()


def childrens_seconds() -> float:
    """Returns the CPU time of child processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass(frozen=True)
class Run:
    """Outcome of a run.

    Attributes
    ----------
    moments : a snapshot each time that value or bound improved; its seconds are CPU time
    value : J by the referee; -inf without a plan
    seconds : CPU time until the method returned, including processes that it started
    elapsed : seconds until then by the method's own clock
    gigabytes : peak memory of the process, including imports and coverage
    solver_bound : bound that a generic solver claims, which has no certificate; else infinite
    """

    moments: tuple[Snapshot, ...]
    value: float
    bound: float
    reason: Reason
    limit: Limit | None
    seconds: float
    elapsed: float = math.nan
    gigabytes: float = math.nan
    message: str = ""
    solver_bound: float = math.inf

    class Error(RuntimeError):
        """A run failed; the message gives the reason."""

    @staticmethod
    @contextmanager
    def one_thread() -> Iterator[None]:
        """Limits the libraries of processes that start in this context to one thread."""
        before = {name: os.environ.get(name) for name in _ONE_THREAD}
        os.environ.update(_ONE_THREAD)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value

    @staticmethod
    def of(build: Build, method: Measurable, seconds: float) -> "Run":
        """Runs a method in its own process, with a limit of CPU time.

        Raises
        ------
        Run.Error
            If the method fails, its process dies, or it keeps running long after its limit.
        """
        (outcome,) = Run.each([build], method, seconds)
        if isinstance(outcome, Run.Error):
            raise outcome
        return outcome

    @staticmethod
    def each(
        builds: Sequence[Build],
        method: Measurable,
        seconds: float,
        patience: float = _MOST_MORE_SECONDS,
    ) -> "Iterator[Run | Run.Error]":
        """Runs a method on one problem after another in one process, and yields each outcome.

        If the process dies, or the method keeps running long after its limit, the remaining
        problems run in another process.

        Parameters
        ----------
        seconds : limit of each run
        patience : s beyond twice the limit, for coverage and for a method that notices limits late
        """
        left = list(builds)
        while left:
            for outcome in _outcomes(left, method, seconds, patience):
                left.pop(0)
                yield outcome

    def told(self, name: str, seed: int) -> Self:
        """Prints a line about the run on standard error, and returns the run."""
        gap = f"gap {100 * self.gap:.4f} %" if math.isfinite(self.gap) else "no gap"
        say(f"{name} seed {seed}: {self.reason} after {self.seconds:.2f} s of CPU time "
            f"({self.elapsed:.2f} s), {gap}, {self.gigabytes:.2f} GB")  # fmt: skip
        return self

    @property
    def finished(self) -> bool:
        """True if no limit stopped it."""
        return self.limit is None

    @property
    def gap(self) -> float:
        """Certified relative gap at the end."""
        return relative_gap(self.value, self.bound)

    @property
    def seconds_to_proof(self) -> float:
        """Seconds until the optimum was proved; infinite if it was not."""
        return self.seconds if self.reason is Reason.OPTIMAL else math.inf

    def gap_after(self, seconds: float) -> float:
        """Returns the certified relative gap after some seconds."""
        if seconds >= self.seconds:
            return self.gap
        before = [moment for moment in self.moments if moment.seconds <= seconds]
        value = max((moment.value for moment in before), default=-math.inf)
        return relative_gap(value, min((moment.bound for moment in before), default=math.inf))

    def seconds_to_gap(self, gap: float) -> float:
        """Returns the seconds until the relative gap was at most this; infinite if it never was."""
        value, bound = -math.inf, math.inf
        for moment in self.moments:
            value, bound = max(value, moment.value), min(bound, moment.bound)
            if relative_gap(value, bound) <= gap:
                return moment.seconds
        return self.seconds if self.gap <= gap else math.inf

    def seconds_to_bound(self, bound: float) -> float:
        """Returns the seconds until the bound was at most this; infinite if it never was."""
        first = (moment.seconds for moment in self.moments if moment.bound <= bound)
        return next(first, self.seconds if self.bound <= bound else math.inf)


def scene(name_or_path: str, seed: int, horizon: int | None = None) -> Problem:
    """Builds a scene; with `horizon`, it is cut off after so many steps."""
    problem = load_scene(name_or_path, seed)
    return problem if horizon is None else problem.replace(horizon=horizon)


def _warm_up(method: Measurable) -> None:
    """Imports libraries that methods import only when they need them."""
    TimedRun.of(_prepared(partial(scene, "tiny-share", 0)), method, TimeLimit(_WARM_UP_SECONDS))
    small = _prepared(partial(scene, "bottleneck", 0, 4))
    run(small, BOUND_METHOD, TimeLimit(_WARM_UP_SECONDS))


def _measured(build: Build, method: Measurable, seconds: float) -> Run:
    """Runs a method with a limit of CPU time in this process."""
    problem = _prepared(build)
    moments: list[Snapshot] = []
    stop = ProcessorLimit(seconds)

    def note(snapshot: Snapshot) -> None:
        value, bound = snapshot.value, max(snapshot.bound, snapshot.value)
        if not moments or (value, bound) != (moments[-1].value, moments[-1].bound):
            moments.append(Snapshot(value, bound, stop.seconds))

    judged, processor, gigabytes = TimedRun.of(problem, method, stop, report=note)
    result = judged.result
    if result.plan is not None and not judged.valid:
        raise Run.Error("the plan breaks a collision rule")
    return Run(
        tuple(moments), judged.reward, result.bound, result.reason, result.limit, processor,
        result.seconds, gigabytes, result.message, result.statistics.get("solver_bound", math.inf),
    )  # fmt: skip


class ProcessorLimit(Stop):
    """Reached after so many seconds of CPU time of this process and its child processes."""

    def __init__(self, most: float) -> None:
        self._most, self._begin = most, processor_seconds()

    @property
    def seconds(self) -> float:
        """The CPU time in seconds since it was made."""
        return processor_seconds() - self._begin

    def reached(self) -> Limit | None:
        """Returns `Limit.TIME` once the CPU time is up."""
        return Limit.TIME if self.seconds >= self._most else None

    @property
    def seconds_left(self) -> float:
        """CPU time until the limit (s, >= 0); solvers treat it as wall-clock time."""
        return max(0.0, self._most - self.seconds)


def _outcomes(
    builds: Sequence[Build], method: Measurable, seconds: float, patience: float
) -> "Iterator[Run | Run.Error]":
    """Yields the outcomes of a process until all are done, or the process dies or is killed."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, builds, method, seconds))
    with Run.one_thread():
        process.start()
    sender.close()
    try:
        for _ in builds:
            if not receiver.poll(2 * seconds + patience):
                words = f"the method was killed: it kept running after its limit of {seconds:g} s"
                yield Run.Error(words)
                return
            outcome: Run | str = receiver.recv()
            yield Run.Error(outcome) if isinstance(outcome, str) else outcome
    except EOFError:
        process.join()
        yield Run.Error(f"the process died (exit code {process.exitcode})")
    finally:
        process.kill()
        process.join()
        receiver.close()


def _send(sender: Connection, builds: Sequence[Build], method: Measurable, seconds: float) -> None:
    Thread(target=_end_with_parent, daemon=True).start()
    with suppress(Exception):  # an error here also occurs in the runs, which report it
        _warm_up(method)
    for build in builds:
        try:
            sender.send(_measured(build, method, seconds))
        except Exception as error:  # any error is sent to the caller
            sender.send(f"{type(error).__name__}: {error}")


def _end_with_parent() -> None:
    """Ends this process if its parent is killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _prepared(build: Build) -> Problem:
    """Builds a problem and computes its coverage."""
    problem = build()
    compiled(problem).prepare_all(never)
    return problem
