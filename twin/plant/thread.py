"""An uneven screw: travel, zero and stiffness of its nut at its present place (plant/14).

The sub-steps use constant values of a screw, which are updated once a window. With the nut at x_0 for rotor angle 0,
mean travel r and amplitude a of the error that repeats every turn, the nut is at

    n(th) = x_0 + r th + a (sin u - sin(x_0/r))          u = th + x_0/r: the same place has the same error

and the sub-steps use its tangent at th_0, so that nut and shaft do the same work on one another:

    r_here = r + a cos u         x_0,here = n(th_0) - r_here th_0

At the end of a window of h the tangent is off by a (w h)^2 / 2: 1 nm with 5 um at 6 turns a second and 0.5 ms. The
stiffness is that of bearing and nut and of the free length of the screw (isel_twin.drives.screw). From one window to
the next a nut keeps its stretch, not its force: at 60 mm/s that is 2e-5 of what is stored in it.
"""

import math

import numpy as np

from isel_twin.base.compiling import contains, njit
from isel_twin.drives import trigonometry
from isel_twin.drives.screw import Screw
from isel_twin.drives.trigonometry import sine_and_cosine

# a screw, uneven or not
SCREW = np.dtype(
    [
        ("start_m", "f8"),  # x_0
        ("travel_m_per_rad", "f8"),  # r
        ("cyclic_m", "f8"),  # a
        ("soft_m_per_n", "f8"),  # compliance of bearing and nut
        ("free_m", "f8"),  # free length at joint position 0
        ("rod_n", "f8"),  # E A, inf: the same stiffness everywhere
    ],
    align=True,
)


def laid_screw(screw: Screw) -> tuple[float, ...]:
    """The values of a SCREW, the place of its nut left out."""
    travel_m_per_rad, soft_m_per_n = screw.travel_m_per_rad, screw.bearing_m_per_n
    return 0.0, travel_m_per_rad, screw.cyclic_error_m, soft_m_per_n, screw.free_length_m, screw.rod_n


@njit(nogil=True, error_model="numpy")
def feel(screws, axes, drives, states):
    """Update the drives by their screws at the nuts: [3] SCREW, AXIS, AXIS_PARAMETERS, AXIS_STATE."""
    for i in range(screws.shape[0]):
        screw, drive, theta_rad = screws[i], drives[i], states[i].theta_rad
        place_m = screw.start_m + screw.travel_m_per_rad * theta_rad
        if screw.cyclic_m != 0.0:
            turn_rad = screw.start_m / screw.travel_m_per_rad
            sine, cosine = sine_and_cosine(theta_rad + turn_rad)
            start_sine, _ = sine_and_cosine(turn_rad)
            nut_m = place_m + screw.cyclic_m * (sine - start_sine)
            drive.travel_m_per_rad = screw.travel_m_per_rad + screw.cyclic_m * cosine
            axes[i].zero_m = nut_m - drive.travel_m_per_rad * theta_rad
        if screw.rod_n < math.inf:
            free_m = max(0.0, place_m + screw.free_m)
            drive.stiffness_n_per_m = 1.0 / (screw.soft_m_per_n + free_m / screw.rod_n)


contains(__name__, trigonometry.__file__)
