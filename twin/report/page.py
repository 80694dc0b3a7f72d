"""A self-contained HTML page with style and script, and a policy that forbids loading anything else."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Sequence
from importlib.resources import files

from isel_twin.report.svg import escape


def whole_page(title: str, body: Iterable[str], scripts: Sequence[str] = (), style: str = "report.css") -> str:
    """The page; body: its parts, empty ones are skipped. scripts, style: names of files in this folder."""
    style = _part(style)
    allowed = f"style-src '{_hashed(style)}'; "
    end = "</body></html>\n"
    if scripts:
        code = "\n".join(map(_part, scripts))
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
    """The hash of a part of the page for the Content-Security-Policy."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
