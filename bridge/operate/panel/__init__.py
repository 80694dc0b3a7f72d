"""The operator panel: a page that shows the machine moving and lets people press, break, type and hold time.

    guest.py    at the server: does what browsers ask (control.py's Operator), samples the twin      its loop
    menu.py     everything an event can do, for the forms of the page
    monitor.py  the serial line in words
    site.py     page, scene and browsers: one port, one origin                                       a thread of its own
    gate.py     who is let in
    guarded.py  viser's web server, kept behind that gate
    pages.py    what a browser gets by GET
    view.py     the machine in viser's scene
    scene.py    the machine's model as meshes, the trail of the tool
    page/       what a browser gets: HTML, style, script

Two threads meet in two places only: requests go through a queue, and the server is woken; frames of plain numbers and
words go the other way. Needs the extra `panel`.
"""
