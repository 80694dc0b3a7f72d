"""Identification: the numbers of machine.toml from recordings of a real machine and measurements at it.

    recordings (tap, --record) ---.
    measured.toml, .csv  ---------+--> Session --- replay on a twin with candidate numbers ---> predictions
    machine.toml, --prior  --> Unknown, prior range --'                    |
                                                                           v
    what is identifiable    <-- Jacobian -->  least squares  -->  estimates, intervals, correlations
                                                                           |
                             held-back recordings predicted better?  -- no --> refused
                                                                     `- yes -> machine.toml patch, grade "measured"

    unknowns.py     named parameters, the keys they stand for, prior ranges
    measured.py     the file of measurements
    session.py      a recording with its measurements, and their prediction by a candidate machine
    model.py        predictions on candidates, residuals, their differences
    fit.py          sensitivity, rank, least squares, intervals, chi-square; fitted and held back
    reach.py        which numbers behind a common factor no datum moves
    laws.py         laws that compete with the fitted ones, compared by held-back data
    patch.py        the result as a machine, as JSON
    page.py         the result as a page
    experiment.py   informative moves as a job, and a file to fill in
    choice.py       which of them are most informative
    stand_in.py     the same experiment carried out on a twin, with gauge noise

docs/identification.md shows it from the first move to the patch. The method: many/8.
"""
