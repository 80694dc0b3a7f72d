"""The site (`make site`): the pages of this folder as they are, by Sphinx with MyST."""

import re
from pathlib import Path

version = release = re.search(
    r'"(.+)"', Path(__file__, "../../twin/version.py").resolve().read_text().split("VERSION")[1]
)[1]
project, author, copyright = "isel-twin", "the isel-twin authors", "the isel-twin authors, Apache-2.0"
extensions = ["myst_parser"]
myst_heading_anchors = 3
suppress_warnings = ["myst.header", "misc.highlighting_failure"]  # a drawing in mermaid stays text
html_theme = "furo"
html_title = f"isel-twin {version}"
exclude_patterns = ["examples"]
