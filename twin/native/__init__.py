"""The compiled core: one small C library, whose functions take numpy arrays.

    core.balance(memory, qpos, weight)      twin/plant/weighing.c: API void balance(R(MEMORY, memory), ...)

The C functions marked `API` stand beside the Python modules that call them; core.c includes them all. A prototype is
the only place that says what a function takes: the library carries its text, and a call is checked against it.

    int64_t, double          a number
    A1(T, a), A2(T, a)       an array of one or two dimensions, in one piece; C gets its address and its shape
    A2(T, a, n + 1, 3)       the same with its lengths: a name is the same number wherever a call has it
    R(T, a)                  an array of which C uses the first element
    T *a                     an address, kept by the caller (`address`)

T is int8_t, uint8_t, int16_t, int32_t, int64_t, double or a record of `record`; `const` if C only reads it. `raw` gives
a function without these checks, for the few calls whose cost counts.
"""

from __future__ import annotations

from isel_twin.native.library import Core, CoreError, address, record

__all__ = ["Core", "CoreError", "address", "core", "record"]

core = Core()
