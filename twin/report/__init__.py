"""Reports for people: the page or picture of a job, and the elements of all pages.

report.py    the page: verdict, findings, path, time plots, commands
columns.py   samples reduced to the columns of a screen
path.py      the path in two views; times.py: all plots over time
playback.py  a recorded session that plays by itself: playback.js, machine.js, scope.js
svg.py, page.py, report.css, report.js    elements of all pages
picture.py   the report as a picture; sketch.py: a quick one for a test that has failed
"""
