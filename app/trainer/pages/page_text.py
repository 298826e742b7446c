"""What stands over a page's picture: its title, its notes, and what must be said."""

import html
from collections.abc import Sequence

__all__ = ["titled_page"]

_OVERLAY = """
<style>
#about { position: fixed; bottom: 3rem; left: 0; z-index: 1; max-width: 34rem;
  padding: 1rem 1.25rem; color: #f4e6dc; pointer-events: none;
  font: 0.85rem/1.45 system-ui, sans-serif; text-shadow: 0 0 4px #000, 0 0 8px #000; }
#about h1 { margin: 0 0 0.25rem; font-size: 1.25rem; font-weight: 600; }
#about p { margin: 0; opacity: 0.85; }
#about #caption { font-size: 1.05rem; opacity: 1; white-space: pre-wrap; min-height: 1.45em; }
#about p.warning { margin-top: 0.35rem; color: #ffd166; opacity: 1; }
@media (max-height: 32rem) { #about p.note { display: none; } }
</style>
<div id="about">
<h1>@title</h1>
<p id="caption"></p>
@notes
<p class="warning">Not clinically validated, not a medical device.</p>
</div>
"""


def titled_page(page: str, title: str, notes: Sequence[str]) -> str:
    """Return a page with a title over its picture and in the browser's tab."""
    shown = html.escape(title)
    lines = "\n".join(f'<p class="note">{html.escape(note)}</p>' for note in notes)
    overlay = _OVERLAY.replace("@title", shown).replace("@notes", lines)
    # The page's own script holds such tags as text: its head's is the first, its body's the last.
    before, after = page.split("<title>", 1)
    after = after.split("</title>", 1)[1]
    body, end = after.rsplit("</body>", 1)
    return f"{before}<title>{shown}</title>{body}{overlay}</body>{end}"
