"""The operator panel: a page that shows the machine in motion, with keys, faults, commands and control of time.

    guest.py    at the server: carries out requests (control.py's Operator), samples the twin        its loop
    sender.py   lines sent as a host sends them: paused, held, gone on with
    job.py      a job file opened in a browser
    desk.py     moves by hand: jog, home, go to, zero of the workpiece
    menu.py     everything an event can do, for the forms of the page
    plots.py    what lies between two frames
    monitor.py  the serial line in words
    site.py     page, scene and browsers: one port, one origin                                       a thread of its own
    gate.py     access
    guarded.py  viser's web server, kept behind that gate
    pages.py    what a browser gets by GET
    recorded.py a recording instead of a machine
    view.py     the machine in viser's scene
    page/       what a browser gets: HTML, style, script

The two threads exchange only two things: requests through a queue, which wakes the server, and frames of plain numbers
and text the other way. Needs the optional packages `panel`.
"""
