"""A machine identified: the numbers of machine.toml found from what a real machine did and what was measured at it.

    recordings (tap, --record) ---.
    measured.toml, .csv  ---------+--> Session --- replay on a twin with candidate numbers ---> what it predicts
    machine.toml, --prior  --> Unknown, prior range --'                    |
                                                                           v
    what the data can tell  <-- Jacobian -->  least squares  -->  estimates, intervals, correlations
                                                                           |
                             held-back recordings predicted better?  -- no --> refused
                                                                     `- yes -> machine.toml patch, grade "measured"

    unknowns.py     named parameters, the keys they stand for, prior ranges
    measured.py     the file of what was measured
    session.py      a recording with its measurements, and what a machine would have given in their place
    fit.py          sensitivity, rank, least squares, intervals; fitted and held back
    patch.py        the result as a machine, as JSON
    page.py         the result as a page
    experiment.py   moves that tell something; a job and a file to fill in
    choice.py       which of them would tell most
    stand_in.py     the same experiment carried out on a twin, gauge noise and all

docs/identification.md shows it from the first move to the patch. The method: many/8.
"""
