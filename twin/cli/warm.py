"""`isel-twin warm`: compile the physics before somebody waits for it, for example while an image is built."""

from __future__ import annotations

from isel_twin.cli.options import Json


def warm(*, json: Json = False) -> int:
    """Compile the physics now and keep it, so that no later start waits for it.

    It is kept beside the package if that folder can be written to, else in the user's cache folder, or where
    NUMBA_CACHE_DIR says, and holds for this kind of processor. An image for many kinds is built and run with
    NUMBA_CPU_NAME=generic and an empty NUMBA_CPU_FEATURES.
    """
    from isel_twin.cli.outputs import say_json
    from isel_twin.core.warm import kept_in, warm_up_all

    told: list[str] = []
    warm_up_all(told.append)
    folder = kept_in()
    if json:
        say_json({"compiled": bool(told), "folder": folder and str(folder)})
    elif folder is None:
        print("compiled, but there is no folder to keep it in; name one by NUMBA_CACHE_DIR")
    else:
        print(f"{'compiled' if told else 'compiled already'}; kept in {folder}")
    return 0 if folder else 1
