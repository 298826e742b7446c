"""Typeset equations as MathML when the site is built, which browsers draw by themselves."""

import html as text
import re

from latex2mathml.converter import convert

EQUATION = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_page_content(html: str, **_: object) -> str:
    """Return a page's HTML with its equations as MathML."""
    return EQUATION.sub(_mathml, html)


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found[2] == "[" else "inline"
    return convert(text.unescape(found[3]).strip(), display=display)
