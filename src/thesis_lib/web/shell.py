"""The frame of a page of its own, which loads nothing: its own policy enforces it."""

from __future__ import annotations

from html import escape

from pygments.formatters import HtmlFormatter  # type: ignore[import-untyped, unused-ignore]

from thesis_lib.web.fragment import asset

_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' blob: data:; style-src 'unsafe-inline'; "
    "img-src data: blob:; media-src data: blob:; font-src data:; connect-src data: blob:"
)
_CSS = asset("page.css")
# Equations are where `_math` has put them, and nowhere else: not in what readers have named. And
# what they say makes no links, attributes or scripts.
_MATHJAX_SETUP = """{
  options: {enableMenu: false, ignoreHtmlClass: "plain", processHtmlClass: "math"},
  tex: {packages: {"[-]": ["html", "require", "autoload"]}},
  svg: {fontCache: "local"}}"""
_CODE_CSS = "\n".join(
    (
        HtmlFormatter(style="xcode", nobackground=True).get_style_defs(".highlight"),
        "@media (prefers-color-scheme: dark) {",
        HtmlFormatter(style="github-dark", nobackground=True).get_style_defs(".highlight"),
        "}",
    )
)


def shell(title: str, body: str, mathjax: str = "") -> str:
    """A whole HTML page around `body`, which loads nothing; with MathJax if that is given."""
    body = body.replace("<pre>", '<pre tabindex="0">')  # wide ones scroll, also by keyboard
    scripts = ""
    if mathjax:
        setup = f"window.MathJax = {_MATHJAX_SETUP};"
        scripts = f"<script>{setup}</script>\n<script>{mathjax}</script>\n"
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<link rel="icon" href="data:,">
<style>
{_CSS}{_CODE_CSS}</style>
</head>
<body class="plain">
<main>
{body}
</main>
{scripts}</body>
</html>
"""
