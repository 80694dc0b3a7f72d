"""A controller alone makes what it makes in a twin, and what is not the path is noticed."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random

import numpy as np
import pytest
from cam.alone import Alone
from cam.played import END, FAST, Made, Player, arc, axes_of, check_played, line, rapid
from cam.random_paths import random_path

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Element


@pytest.mark.parametrize("controller", ["imc-s8", "ismif", "gmi99", "bwo900"])
def test_its_counters_go_the_same_way(controller: str) -> None:
    """Behind a rapid, whose way begins where the path before has ended: step by step."""
    players = Alone(controller, axes_of(controller)), Player(controller, axes_of(controller))
    for seed in range(2):
        alone, twin = (player.play(random_path(Random(seed), part=0.05)).counts for player in players)
        assert np.array_equal(alone, twin) if seed else np.array_equal(alone[-1], twin[-1])
        assert players[0].start == players[1].start


PATH = [rapid(50, 50, -5), line(52, 51, -5), arc((54, 51, -5), (53, 51, 0), -1), END]
OTHERS = {
    "end": [*PATH[:2], arc((54, 51.02, -5), (53, 51.01, 0), -1), END],
    "corner": [PATH[0], line(52, 51.1, -5), arc((54, 51, -5), (53, 51, 0), -1), END],
    "sense": [*PATH[:2], arc((54, 51, -5), (53, 51, 0), 1), END],
    "turns": [*PATH[:2], arc((54, 51, -5), (53, 51, 0), -2), END],
    "part": [PATH[0], line(54, 51, -5), END],
}


@pytest.mark.parametrize("what", OTHERS)
def test_another_path_is_noticed(what: str) -> None:
    class Otherwise(Alone):
        def play(self, path: Iterable[Element], settings: CamSettings = FAST) -> Made:
            return super().play(OTHERS[what], settings)

    check_played(Alone("ismif", axes_of("ismif")), PATH)
    with pytest.raises(AssertionError):
        check_played(Otherwise("ismif", axes_of("ismif")), PATH)
