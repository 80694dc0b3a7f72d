"""A page that needs nothing else: HTML with its style and script in it, and a policy that forbids everything else."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable
from importlib.resources import files

from isel_twin.report.svg import escape


def whole_page(title: str, body: Iterable[str], script: str = "") -> str:
    """The page; body: parts of it, empty ones are left out. script: name of a file beside this one."""
    style = _part("report.css")
    allowed = f"style-src '{_hashed(style)}'; "
    end = "</body></html>\n"
    if script:
        code = _part(script)
        allowed += f"script-src '{_hashed(code)}'; "
        end = f"<script>{code}</script>{end}"
    policy = f"default-src 'none'; {allowed}base-uri 'none'; form-action 'none'"
    parts = [
        "<!DOCTYPE html>",
        "<html lang='en'><head><meta charset='utf-8'>",
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        "<meta name='viewport' content='width=device-width, initial-scale=1'>",
        f"<title>{escape(title)}</title><style>{style}</style></head><body>",
        *body,
        end,
    ]
    return "\n".join(part for part in parts if part)


def _part(name: str) -> str:
    return files("isel_twin.report").joinpath(name).read_text(encoding="utf-8")


def _hashed(text: str) -> str:
    """The name of a part of the page in a Content-Security-Policy."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
