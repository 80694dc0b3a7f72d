"""A screw, uneven or not, as the loop has it; its law is in thread.h."""

from isel_twin.drives.screw import Screw
from isel_twin.native import record

SCREW = record(
    "SCREW",
    [
        ("start_m", "f8"),  # x_0
        ("travel_m_per_rad", "f8"),  # r
        ("cyclic_m", "f8"),  # a
        ("soft_m_per_n", "f8"),  # compliance of bearing and nut
        ("free_m", "f8"),  # free length at joint position 0
        ("rod_n", "f8"),  # E A, inf: the same stiffness everywhere
    ],
)


def laid_screw(screw: Screw) -> tuple[float, ...]:
    """The values of a SCREW, the place of its nut left out."""
    travel_m_per_rad, soft_m_per_n = screw.travel_m_per_rad, screw.bearing_m_per_n
    return 0.0, travel_m_per_rad, screw.cyclic_error_m, soft_m_per_n, screw.free_length_m, screw.rod_n
