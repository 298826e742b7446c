"""Write the commands' reference from their help, when the site is built."""

import subprocess
import sys

PAGE, PLACE = "commands.md", "<!-- commands -->"


def on_page_markdown(markdown: str, page: object, **_: object) -> str:
    """Return a page's text; that of the commands with what their help says."""
    if getattr(page, "file").src_uri != PAGE:  # noqa: B009
        return markdown
    words = [sys.executable, "-m", "typer", "app.command_line.program", "utils", "docs"]
    done = subprocess.run(  # noqa: S603
        [*words, "--name", "bluntdissect"], check=True, capture_output=True, text=True
    )
    commands = done.stdout[done.stdout.index("## `") :]
    return markdown.replace(PLACE, commands)
