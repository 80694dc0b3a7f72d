"""What people look at: the page or picture about a job, and what any page is made of.

report.py    the page: verdict, findings, path, time plots, commands
columns.py   samples as the columns of a screen
path.py      the path in two views; times.py: everything above one axis of time
svg.py, page.py, report.css, report.js    what every page is made of
picture.py   the report as a picture; sketch.py: a quick one for a test that has failed
"""
