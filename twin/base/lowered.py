"""Compiled functions as a package brings them: numba has done its part, the processor they run on is still open.

    source --- numba: types, LLVM's language ---> lowered --- LLVM: optimised, machine code ---> kept for this processor
               when a package is built                        on each machine, once: a tenth of the work

Lowered code is what numba would hand to LLVM, so that both ways end in the same machine code. It holds for one version
of Python, numba and LLVM and one kind of machine, which name its folder, and for the source files of which it holds a
digest; where there is none that fits, numba begins at the source (core/10). A checkout has none, until
twin/core/lower.py writes them.
"""

from __future__ import annotations

import io
import pickle
import sys
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import llvmlite
import numba
from llvmlite import binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, compile_result
from numba.core.environment import Environment, lookup_environment

from isel_twin.base.files import atomic_write
from isel_twin.base.object_code import digest

FOLDER: Final = Path(__file__).parents[1] / "lowered"  # of the package

_out: Path | None = None  # where what is compiled is written, too


def write_to(folder: Path) -> None:
    """From now on in this process, what is compiled is also written to a folder, as FOLDER holds it."""
    global _out
    _out = folder


def kind() -> str:
    """What lowered code depends on, as the name of a folder."""
    python = f"{sys.implementation.cache_tag}{getattr(sys, 'abiflags', '')}"
    return f"{python}-numba{numba.__version__}-llvmlite{llvmlite.__version__}-{binding.get_process_triple()}"


class Pipeline(Compiler):
    """numba's compiler, which makes libraries of the kinds below."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        library = Inner if state.flags.no_cpython_wrapper else Outer
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        pipelines: list[Any] = super().define_pipelines()
        return pipelines


class Outer(JITCodeLibrary):
    """A function that Python calls, with all that it calls."""

    lowered: bytes | None = None

    def _optimize_final_module(self) -> None:
        if _out is not None:
            self.lowered = self._final_module.as_bitcode()
        super()._optimize_final_module()


class Inner(JITCodeLibrary):
    """A function that only compiled functions call: it is optimised and becomes machine code as a part of those."""

    def _optimize_final_module(self) -> None:
        """Nothing."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, _: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, _name: str, _environment: Any) -> None:
        """It has none of its own."""


def keep(function: Callable[..., Any], files: Sequence[str], types: Any, compiled: Any) -> None:
    """Write the lowered code of a function for these types, if somebody asked for it; none with an address in it, which
    is of one process."""
    lowered = getattr(compiled.library, "lowered", None)
    if _out is None or lowered is None or compiled.library.has_dynamic_globals:
        return
    file = _out / kind() / _name(function)
    known = _read(file, function, files)
    file.parent.mkdir(parents=True, exist_ok=True)
    _, *described, _annotation, reloads, environments = compiled._reduce()
    stamp = digest((function.__code__.co_filename, *files))
    content = stamp, {**known, types: (lowered, *described, reloads, environments)}
    atomic_write(file, zlib.compress(pickle.dumps(content), 9))


def finished(function: Callable[..., Any], files: Sequence[str], types: Any, target: Any) -> CompileResult | None:
    """The function for these types, from lowered code; None if there is none."""
    found = _read(FOLDER / kind() / _name(function), function, files).get(types)
    if found is None:
        return None
    lowered, described, environment, signature, objectmode, lifted, reloads, environments = found
    library = JITCodeLibrary(target.codegen(), described.qualname)
    library._final_module = binding.parse_bitcode(lowered)
    library.enable_object_caching()
    library.finalize()
    for reload in reloads:
        reload()
    entry = target.get_executable(library, described, environment)
    for one in environments:
        library.codegen.set_env(one.env_name, one)
    made: CompileResult = compile_result(
        typing_context=target.typing_context, target_context=target, entry_point=entry, type_annotation="",
        signature=signature, objectmode=objectmode, lifted=lifted, fndesc=described, library=library,
        environment=environment, reload_init=reloads, referenced_envs=environments,
    )  # fmt: skip
    return made


class Unpickler(pickle.Unpickler):
    """Imports no module for the sake of its globals, which compiled code does not use: 20 ms less at every start."""

    def find_class(self, module: str, name: str) -> Any:
        return _environment if name == "_rebuild_env" else super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Environment:
    found = lookup_environment(name)
    if found is None:
        found = Environment._memo[name] = Environment({"__name__": module})
        found.consts[:] = constants
        found.env_name = name
    return found


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}.{function.__name__}"


def _read(file: Path, function: Callable[..., Any], files: Sequence[str]) -> dict[Any, Any]:
    """The lowered codes of a file by their types; none if there is no such file or the sources are others."""
    if not file.is_file():
        return {}
    try:
        stamp, codes = Unpickler(io.BytesIO(zlib.decompress(file.read_bytes()))).load()
        return dict(codes) if stamp == digest((function.__code__.co_filename, *files)) else {}
    except Exception:  # damaged bytes raise anything; then it is compiled
        return {}
