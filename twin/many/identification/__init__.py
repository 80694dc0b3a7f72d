"""Identification: the numbers of machine.toml from recordings of a real machine and measurements at it.

    recordings (tap, --record) ---.
    measured.toml, .csv  ---------+--> Session --- replay on a twin with candidate numbers ---> predictions
    machine.toml, --prior  --> Unknown, prior range --'                    |
                                                                           v
    what is identifiable    <-- Jacobian -->  least squares  -->  estimates, intervals, correlations
                                                                           |
                             held-back recordings predicted better?  -- no --> refused
                                                                     `- yes -> machine.toml patch, graded

    unknowns.py     named parameters, the keys they stand for, prior ranges
    measured.py     the file of measurements
    session.py      a recording with its measurements, and their prediction by a candidate machine
    noise.py        noise of gauges and clocks from repeats
    trajectory.py   positions in a recording as readings in motion
    replays.py      replays, counted and kept in a journal
    model.py        predictions on candidates, residuals, their differences
    fit.py          sensitivity, rank, least squares, intervals, chi-square; fitted and held back
    chi_square.py   chi-square by kind of datum
    profile.py      how wide an interval the likelihood wants
    reach.py        which numbers behind a common factor no datum moves
    recovery.py     families of parameters that a fit must find back
    laws.py         laws that compete with the fitted ones, compared by held-back data
    patch.py        the result as a machine, as JSON
    page.py         the result as a page
    experiment.py   informative moves as a job, and a file to fill in
    protocol.py     a measuring day by ISO 230, and its numbers
    ring_down.py    frequency and damping from a sound or an accelerometer
    sealed.py       what is predicted of such a day, sealed, and its score
    choice.py       which of them are most informative
    stand_in.py     the same experiment carried out on a twin, with gauge noise

docs/identification.md shows it from the first move to the patch. The method: many/8.
"""
