"""What numba compiles, and where it is kept: imported when a compiled function is first needed (compiling.py).

numba caches compiled code in `__pycache__` beside the source, else in the user's cache folder or in NUMBA_CACHE_DIR. It
raises if it cannot write there or the disk is full. Here the function works all the same: it is compiled again in each
process, and the log says once what that costs and what to do. And code is found in any of those folders that can be
read, such as one of an image whose kernels root has compiled for all users.
"""

from __future__ import annotations

import gc
import hashlib
import logging
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numba
from numba.core import event, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, NullCache
from numba.core.runtime import rtsys
from numba.np.numpy_support import as_dtype

from isel_twin.base import lowered, object_code
from isel_twin.base.compile_watch import compiling
from isel_twin.base.files import atomic_write

log = logging.getLogger("isel_twin")

_CHECKED: set[str] = set()  # modules whose cached code is not stale
_said = False


def dispatcher(function: Callable[..., Any], options: dict[str, Any], files: tuple[str, ...] = ()) -> Any:
    """numba's njit of a function with these options and, if possible, a cache on the disk; no entry for C, which would
    be a tenth of what there is to compile.

    files: whose code is compiled into it beside its own.
    """
    all_options: dict[str, Any] = {"no_cfunc_wrapper": True, "pipeline_class": lowered.Pipeline, **options}
    compiled: Any = numba.njit(**all_options)(function)
    try:
        compiled._cache = _Cache(function, files)
    except RuntimeError as error:
        if "cannot cache function" not in str(error):
            raise
        compiled._cache = _Unkept(function, files)
    else:
        if files and function.__module__ not in _CHECKED:
            _CHECKED.add(function.__module__)
            drop_stale_code(compiled, files)
    return compiled


def part(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """The same of a function that is only compiled into others: it is kept with those."""
    return numba.njit(**{"no_cfunc_wrapper": True, "pipeline_class": lowered.Pipeline, **options})(function)


def drop_stale_code(function: Any, files: tuple[str, ...]) -> None:
    """Delete numba's cached code of a function's module if other files compiled into it have changed. numba checks only
    the function's own file, so a digest of the others is kept beside the code."""
    cache = function._cache
    if cache.cache_path is None:  # no cache
        return
    folder = Path(cache.cache_path)
    with suppress(OSError):
        if _fresh(folder, function.__module__, files):
            return
        module = function.__module__.rpartition(".")[2]
        for file in folder.glob(f"{module}.*.nb[ci]"):
            file.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        atomic_write(_stamp(folder, function.__module__), object_code.digest(files).encode())


def _fresh(folder: Path, module: str, files: tuple[str, ...]) -> bool:
    """Was the code of a module that a folder holds compiled with these files as they are?"""
    stamp = _stamp(folder, module)
    return stamp.is_file() and stamp.read_bytes() == object_code.digest(files).encode()


def _stamp(folder: Path, module: str) -> Path:
    return folder / f"{module}.drives"


class _Told(event.Listener):
    """Tells of compiling, one thread at a time. Meanwhile no garbage is looked for: numba makes millions of objects
    that all stay, and looking through them is a tenth of the time."""

    def __init__(self) -> None:
        self._depth, self._collects = 0, False

    def on_start(self, _: event.Event) -> None:
        if self._depth == 0 and (collects := gc.isenabled()):
            self._collects = collects
            gc.disable()
        self._depth += 1
        compiling(begins=True)

    def on_end(self, _: event.Event) -> None:
        compiling(begins=False)
        self._depth -= 1
        if self._depth == 0 and self._collects:
            self._collects = False
            gc.enable()


event.register("numba:compile", _Told())


class _Cache(FunctionCache):
    """numba's own cache, except that a full disk is no error, loading is fast, and processes may compile at once; and
    what Python calls is kept as object code as well, if that can do without numba."""

    def __init__(self, function: Callable[..., Any], files: tuple[str, ...]) -> None:
        super().__init__(function)
        self._files = files
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Cached code needs only memory management. numba would prepare for compiling first, which imports hundreds of
        modules, including scipy: 0.4 s of CPU time. It still does so before it compiles."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            if found := self._load_overload(sig, target_context):
                return found
        if found := _readable(self._py_func, self._files, sig, target_context, self._cache_path):
            return found.code
        if found := _finished(self._py_func, self._files, sig, target_context):
            self.save_overload(sig, found)
        return found

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super()._load_overload(sig, target_context)
        except OSError:
            raise
        except Exception:  # bytes that are no code raise anything
            _say(f"compiled code in {self.cache_path} is damaged, and is made anew")
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        lowered.keep(self._py_func, self._files, sig, data)
        try:
            super().save_overload(sig, data)
            if object_code.usable():
                self._keep(data)
        except OSError as error:
            _say(
                f"compiled code cannot be kept ({error.strerror or error}), so each start compiles it anew; "
                "name a folder for it by NUMBA_CACHE_DIR"
            )

    def _keep(self, made: Any) -> None:
        """Keep the object code, if it takes and returns what can be passed without numba."""
        kinds = tuple(map(_kind, made.signature.args))
        returned, symbol = str(made.signature.return_type), made.fndesc.llvm_func_name
        if None in kinds or returned not in object_code.RETURNED or made.library.has_dynamic_globals:
            return
        code = made.library._get_compiled_object()
        missing = object_code.missing(code)
        if missing is None or not object_code.fits(kinds, _words(made.library.get_function(symbol))):
            return
        with suppress(OSError):  # what numba keeps will do
            object_code.keep(self._py_func, self._files, kinds, object_code.Code(symbol, returned, missing, code))


def _kind(numba_type: Any) -> Any:
    """The kind of an argument of this type, as object_code.py has it; None if there is none."""
    if isinstance(numba_type, types.Array):
        if numba_type.layout != "C":
            return None
        return as_dtype(numba_type.dtype), numba_type.ndim, numba_type.mutable
    return {types.int64: int, types.float64: float}.get(numba_type)


def _words(function: Any) -> list[str]:
    return [str(argument.type) for argument in function.arguments]


class _Unkept(NullCache):
    """Where nothing can be kept, but something may be found."""

    cache_path: str | None = None  # of what was found

    def __init__(self, function: Callable[..., Any], files: tuple[str, ...]) -> None:
        self._py_func, self._files = function, files

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        if found := _readable(self._py_func, self._files, sig, target_context):
            self.cache_path = found.folder
            return found.code
        _say("no folder to keep compiled code in, so each start compiles it anew; name one by NUMBA_CACHE_DIR")
        return _finished(self._py_func, self._files, sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        lowered.keep(self._py_func, self._files, sig, data)


class _Found(NamedTuple):
    code: Any
    folder: str


def _readable(
    function: Callable[..., Any], files: tuple[str, ...], signature: Any, target: Any, own: str = ""
) -> _Found | None:
    """The function for these types from one of numba's folders, in its order, whether it can be written to or not, up
    to its own: who names a folder by NUMBA_CACHE_DIR that can be written to wants it there."""
    for place in CompileResultCacheImpl._locator_classes:
        locator = type(place.__name__, (place,), {"ensure_cache_path": lambda _: None})
        implementation = type("Implementation", (CompileResultCacheImpl,), {"_locator_classes": [locator]})
        with suppress(OSError, RuntimeError):  # no such folder
            cache = type("Readable", (_Cache,), {"_impl_class": implementation})(function, files)
            folder = Path(cache.cache_path)
            if cache.cache_path == own:
                break
            if files and not _fresh(folder, function.__module__, files):
                continue
            if found := cache._load_overload(signature, target):
                return _Found(found, cache.cache_path)
    return None


def _finished(function: Callable[..., Any], files: tuple[str, ...], signature: Any, target: Any) -> Any:
    """A function from lowered code, told like one that is compiled."""
    compiling(begins=True)
    try:
        return lowered.finished(function, files, signature, target)
    finally:
        compiling(begins=False)


class _Files(IndexDataCacheFile):
    """The files of one function: an index, and the code for each combination of types.

    numba numbers the codes, and writes the index first: a process that compiles at the same time for other types takes
    the same number, and one that loads may read the code of an earlier source. Either runs the wrong code. Here the
    name of a file follows from the types, and the index names it after it is written.
    """

    def save(self, key: Any, data: Any) -> None:
        name = self._data_name(int(hashlib.sha256(repr(key).encode()).hexdigest()[:15], 16))
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})

    def _load_index(self) -> dict[Any, Any]:
        try:
            return dict(super()._load_index())
        except OSError:
            raise
        except Exception:  # bytes that are no index raise anything
            _say(f"compiled code in {self._cache_path} is damaged, and is made anew")
            return {}

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), "rb") as file:
            return lowered.Unpickler(file).load()


def _say(line: str) -> None:
    """Log a line once in a process, not once a function."""
    global _said
    if not _said:
        _said = True
        log.warning("%s", line)
