"""Job files of CAM programs: read into a neutral toolpath, which the language of a controller writes as its commands.

    part.ncp, part.nc, part.plt  --- reader --->  toolpath  --- language --->  commands, each with its place in the file

toolpath.py   what a toolpath is: rapid, line, arc, dwell, tool, spindle, ...
settings.py   what the file does not say: zero point, tools, heights, speeds
registry.py   which readers are installed, by entry points; which one a file is for
reader.py     what a reader is, and what all of them share: excellon/, gcode/, hpgl/, ncp/ are those of the package
pen.py        a tool whose file has no heights: of plots and drill files
section.py    a part of a toolpath: from a line of its file on, or up to one
course.py     a toolpath in the counts of a machine: rounded, within its travel and its speeds; arcs.py: chords
fitting.py    how far a file reaches, and a zero of the work with which it is within the travel
following.py  what drives that lag make of it
writing.py    what is common to all languages that write it; written.py: what they are told, and give
estimate.py   how long a CAM program thinks that it takes
files.py      the way back: a toolpath as a file
"""
