"""Many environments side by side, in threads or processes, each with the same bits as alone.

    envs = gymnasium.make_vec("isel_twin/JobTuning-v0", num_envs=8, mode="processes")
    envs = TwinVector([make_one] * 8, mode="threads")                       any Gymnasium environments

        actions [n]  --->  cell 0 | cell 1 | ... | cell n-1  --->  observations [n], rewards [n] ...
                           (an environment and how it begins anew)

    mode          a step runs in                 when
    serial        the caller                     one core, or debugging
    threads       `workers` threads              most of a step is compiled code that lets other threads run: no
                                                 copies, and the environments can be looked into (`envs`)
    processes     `workers` processes            any kind of step; each has its own interpreter

Environments are reset as in Gymnasium's own vector environments (`gymnasium.vector.AutoresetMode`):

    next step     the step after the last one of an episode is a reset: its action is not looked at, its reward is 0
    same step     the last step returns the first observation of the next episode; that of the last step and its info
                  are `final_obs` and `final_info` of the infos
    disabled      the caller resets those that are over: options={"reset_mask": [n]}
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, Literal, get_args

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import CloudpickleWrapper, batch_space, concatenate, create_empty_array, iterate
from numpy.typing import NDArray

Mode = Literal["serial", "threads", "processes"]

_PATIENCE_S = 5.0  # time for a process to end by itself

Environment = gymnasium.Env[Any, Any]


class _Cell:
    def __init__(self, make: Callable[[], Environment], autoreset: AutoresetMode) -> None:
        self.env = make()
        self._autoreset, self._over = autoreset, False

    def reset(self, seed: int | None, options: dict[str, Any] | None) -> tuple[Any, dict[str, Any]]:
        self._over = False
        return self.env.reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any], dict[str, Any] | None]:
        """The environment's step, and the final observation and info if the first one is of the next episode."""
        if self._over and self._autoreset is AutoresetMode.NEXT_STEP:
            observation, info = self.reset(None, None)
            return observation, 0.0, False, False, info, None
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._over = terminated or truncated
        if self._over and self._autoreset is AutoresetMode.SAME_STEP:
            final = {"final_obs": observation, "final_info": info}
            observation, info = self.reset(None, None)
            return observation, float(reward), terminated, truncated, info, final
        return observation, float(reward), terminated, truncated, info, None

    def call(self, name: str, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> Any:
        """`env.name`, called if it can be; also of environments inside wrappers."""
        found = self.env.get_wrapper_attr(name)
        return found(*args, **kwargs) if callable(found) else found

    def set_attribute(self, name: str, value: Any) -> None:
        self.env.set_wrapper_attr(name, value)

    def close(self) -> None:
        self.env.close()


class _Threads:
    """All cells in this process; with one worker, in this thread."""

    def __init__(self, cells: Sequence[_Cell], workers: int) -> None:
        self.cells = cells
        self._pool = ThreadPoolExecutor(workers, "isel-twin-envs") if workers > 1 else None

    def do(self, method: str, tasks: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        """Results of a method of some cells, by number of the cell; an error in one is raised here."""

        def one(number: int) -> Any:
            return getattr(self.cells[number], method)(*tasks[number])

        results = map(one, tasks) if self._pool is None else self._pool.map(one, tasks)
        return dict(zip(tasks, results, strict=True))

    def close(self) -> None:
        for cell in self.cells:
            cell.close()
        if self._pool is not None:
            self._pool.shutdown()


class _Processes:
    """Cells evenly distributed to processes, each with a contiguous part."""

    def __init__(
        self, makers: Sequence[Callable[[], Environment]], autoreset: AutoresetMode, workers: int, context: str | None
    ) -> None:
        start = multiprocessing.get_context(context)
        self._process_of: dict[int, int] = {}
        self._ends: list[Connection] = []
        self._processes = []
        for worker, numbers in enumerate(np.array_split(np.arange(len(makers)), workers)):
            mine = {int(number): CloudpickleWrapper(makers[number]) for number in numbers}
            self._process_of |= dict.fromkeys(mine, worker)
            end, other = start.Pipe()
            process = start.Process(  # type: ignore[attr-defined]
                target=_work, args=(other, mine, autoreset), daemon=True, name=f"isel-twin-envs-{worker}"
            )
            process.start()
            other.close()
            self._ends.append(end)
            self._processes.append(process)
        self._receive(range(workers))

    def do(self, method: str, tasks: Mapping[int, tuple[Any, ...]]) -> dict[int, Any]:
        orders: dict[int, dict[int, tuple[Any, ...]]] = {}
        for number, task in tasks.items():
            orders.setdefault(self._process_of[number], {})[number] = task
        for worker, order in orders.items():
            self._ends[worker].send((method, order))
        return self._receive(orders)

    def _receive(self, workers: Iterable[int]) -> dict[int, Any]:
        """Results of all of them; then the first error is raised."""
        results: dict[int, Any] = {}
        errors = []
        for worker in workers:
            try:
                done, error = self._ends[worker].recv()
            except (EOFError, ConnectionError):
                done, error = {}, RuntimeError(f"a process of the environments has ended (number {worker})")
            results |= done
            errors += [error] if error is not None else []
        if errors:
            raise errors[0]
        return results

    def close(self) -> None:
        for end in self._ends:
            with suppress(OSError):
                end.send(None)
        for process in self._processes:
            process.join(_PATIENCE_S)
            if process.is_alive():
                process.terminate()
                process.join()
        for end in self._ends:
            end.close()


def _work(end: Connection, makers: Mapping[int, CloudpickleWrapper], autoreset: AutoresetMode) -> None:
    """A process: calls methods of its cells until None comes."""
    cells: dict[int, _Cell] = {}
    order: tuple[str, dict[int, tuple[Any, ...]]] | None = ("", {})
    with suppress(EOFError, ConnectionError, KeyboardInterrupt):
        while order is not None:
            done: dict[int, Any] = {}
            error = None
            try:
                if not cells:
                    cells = {number: _Cell(make.fn, autoreset) for number, make in makers.items()}
                done = {number: getattr(cells[number], order[0])(*task) for number, task in order[1].items()}
            except Exception as raised:
                error = raised
            end.send((done, error))
            order = end.recv()
    for cell in cells.values():
        cell.close()


class TwinVector(VectorEnv[Any, Any, Any]):
    """Environments side by side; spaces and calls are those of gymnasium.vector.VectorEnv."""

    def __init__(
        self,
        env_fns: Sequence[Callable[[], Environment]],
        mode: Mode = "threads",
        workers: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        context: str | None = None,
    ) -> None:
        """env_fns: each makes one environment; all have the same spaces. context: `multiprocessing.get_context`.

        workers: threads or processes, None: the number of processors; at most one an environment.
        Raises ValueError with one line for a wrong argument, and whatever making an environment raises.
        """
        super().__init__()
        if mode not in get_args(Mode):
            raise ValueError(f"unknown mode {mode!r}; there are: {', '.join(get_args(Mode))}")
        if not env_fns:
            raise ValueError("there is no environment; give at least one")
        if workers is not None and workers < 1:
            raise ValueError(f"workers is {workers}; give at least 1")
        autoreset = AutoresetMode(autoreset_mode)
        many = min(workers or os.cpu_count() or 1, len(env_fns)) if mode != "serial" else 1
        self.num_envs = len(env_fns)
        self.envs: tuple[Environment, ...] = ()  # the environments; none if they are in other processes
        self._crew: _Threads | _Processes
        if mode == "processes":
            first = env_fns[0]()  # for its spaces
            self._crew = _Processes(env_fns, autoreset, many, context)
        else:
            cells = [_Cell(make, autoreset) for make in env_fns]
            self.envs = tuple(cell.env for cell in cells)
            first = cells[0].env
            self._crew = _Threads(cells, many)
        self.metadata = {**first.metadata, "autoreset_mode": autoreset}
        self.render_mode = first.render_mode
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        if mode == "processes":
            first.close()
        self._last: list[Any] = [None] * self.num_envs  # observations

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset all, with seed, seed + 1 ... or a list of seeds; or those of options["reset_mask"], bool [n]."""
        n = self.num_envs
        seeds = [seed + i for i in range(n)] if isinstance(seed, int) else [None] * n if seed is None else list(seed)
        if len(seeds) != n:
            raise ValueError(f"{len(seeds)} seeds for {n} environments")
        rest = dict(options or {})
        mask = np.asarray(rest.pop("reset_mask", np.ones(n, dtype=np.bool_)))
        if mask.shape != (n,) or mask.dtype != np.bool_ or not mask.any():
            raise ValueError(f"reset_mask is {mask!r}; it must be {n} of True and False, one of them True")
        given = rest if options is not None else None
        results = self._crew.do("reset", {i: (seeds[i], given) for i in np.flatnonzero(mask).tolist()})
        infos: dict[str, Any] = {}
        for i, (observation, info) in results.items():
            self._last[i] = observation
            infos = self._add_info(infos, info, i)
        return self._batched(), infos

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One step of each, or a reset after the end of an episode (module docstring)."""
        tasks = {i: (action,) for i, action in enumerate(iterate(self.action_space, actions))}
        results = self._crew.do("step", tasks)
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), dtype=np.bool_)
        infos: dict[str, Any] = {}
        for i in range(self.num_envs):
            self._last[i], rewards[i], terminated[i], truncated[i], info, final = results[i]
            if final is not None:
                infos = self._add_info(infos, final, i)
            infos = self._add_info(infos, info, i)
        return self._batched(), rewards, terminated.copy(), truncated.copy(), infos

    def render(self) -> tuple[Any, ...]:
        return self.call("render")

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Results of a method of each, or an attribute of each."""
        results = self._crew.do("call", {i: (name, args, kwargs) for i in range(self.num_envs)})
        return tuple(results[i] for i in range(self.num_envs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each: to the members of a list or tuple, or all to one value."""
        each = list(values) if isinstance(values, list | tuple) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(f"{len(each)} values for {self.num_envs} environments")
        self._crew.do("set_attribute", {i: (name, value) for i, value in enumerate(each)})

    def close_extras(self, **kwargs: Any) -> None:
        """End threads and processes; called by `close`."""
        self._crew.close()

    def _batched(self) -> Any:
        empty: Any = create_empty_array(self.single_observation_space, self.num_envs, np.zeros)
        return concatenate(self.single_observation_space, self._last, empty)


def tuning_vector(
    num_envs: int = 1,
    mode: Mode = "threads",
    workers: int | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    context: str | None = None,
    **options: Any,
) -> TwinVector:
    """`num_envs` times `isel_twin/JobTuning-v0` with these options, for `gymnasium.make_vec`."""
    make = partial(gymnasium.make, "isel_twin/JobTuning-v0", **options)
    return TwinVector([make] * num_envs, mode, workers, autoreset_mode, context)
