"""Jobs in an editor: a language server, for any editor that speaks the Language Server Protocol (docs/editors.md).

shown.py    what the editor is told: a report as diagnostics, figures as hints, a line explained
server.py   the server: documents as they are typed, each judged in a worker thread
"""
