#!/usr/bin/env bash
# One seed begins other episodes by another way of making many copies of an environment.
#
# Guess: `make_vec(id, num_envs=2).reset(seed=7)` begins the same two episodes whichever vectorization_mode it takes: the
#        mode is about speed.
# Seen:  for CartPole-v1 the default (the environment's own vector class) draws all copies from one generator, `sync` gives
#        each copy a generator and a seed of its own. Not even the first copy begins alike.
# Here:  a learning curve is compared with another by its seeds. The twin's vector environments seed each copy as `sync`
#        does.
# With:  Gymnasium 1.4.0, 2026-11-28
set -euo pipefail
cd "$(mktemp -d)" && trap 'rm -rf "$PWD"' EXIT
python3 -m venv venv && venv/bin/pip install --quiet --disable-pip-version-check gymnasium==1.4.0 || exit 3

venv/bin/python - <<'PY'
import sys

import gymnasium
import numpy as np

print(f"Gymnasium {gymnasium.__version__}, CartPole-v1, two copies, seed 7:")
begun = {}
for mode in ("sync", "vector_entry_point"):
    begun[mode], _ = gymnasium.make_vec("CartPole-v1", num_envs=2, vectorization_mode=mode).reset(seed=7)
    print(f"  {mode}:", *(np.round(state.astype(float), 4).tolist() for state in begun[mode]))
default, _ = gymnasium.make_vec("CartPole-v1", num_envs=2).reset(seed=7)
same = (begun["sync"] == begun["vector_entry_point"]).all(axis=1)
print(f"  the same: {same.tolist()}")
sys.exit(bool(same.any() or (default != begun["vector_entry_point"]).any()))
PY
