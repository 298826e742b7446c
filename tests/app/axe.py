"""axe-core judges whether a page can be used by everyone."""

from browser import TrainerPage
from other_programs import package
from playwright.sync_api import Page

JUDGED = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice")


STILL = """() => document.getAnimations().every(each => each.playState !== "running")"""
"""Nothing fades in or out, which has less contrast on its way."""


def no_faults(tab: TrainerPage, where: str) -> None:
    """Check that axe-core finds nothing once a page has come to rest."""

    def check() -> None:
        tab.page.wait_for_function(STILL)
        found = faults(tab.page, where)
        assert not found, found

    tab.eventually(check, 30.0)


def faults(page: Page, where: str) -> list[str]:
    """What axe-core finds, however it weighs that."""
    if not page.evaluate("() => !!window.axe"):
        page.evaluate((package("axe-core") / "axe.min.js").read_text())
    found = page.evaluate(
        "tags => axe.run(document, {runOnly: tags, resultTypes: ['violations']})", JUDGED
    )
    return [
        f"{where}: {fault['id']} at {node['html'][:120]} {node['failureSummary']}"
        for fault in found["violations"]
        for node in fault["nodes"]
    ]
