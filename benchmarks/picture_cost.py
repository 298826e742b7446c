"""What a picture of each scene costs: draw calls, triangles, and processor time where that draws.

``python -m benchmarks.picture_cost`` needs Chromium and playwright. It draws each scene at
800 x 600 in the full and in the plain look, Calot's triangle covered and cleared.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import psutil
from playwright.sync_api import Page, expect
from rich.console import Console

from app.command_line.load import shipped_organ
from app.simulation import CarefulRun, Replay, run_json
from assets import RUNS
from benchmarks.browser_page import PATIENCE_MS, browser_page, served

WIDE, HIGH = 800, 600
SECONDS = 15.0
CLEARED_S = 290.0
"""Of the recorded critical view: its triangle is cleared, and nothing is clipped yet."""
PROGRAM = sys.executable, "-c", "from app.command_line.program import main; main()"

DRAWN = """() => window.bluntdissectScope?.picture?.drawn > 2
    || window.__viserMutable?.nodeRefFromName?.['/organ/skin']"""
BESIDE = """() => { const { canvas } = window.__viserMutable;
    return [innerWidth - canvas.clientWidth, innerHeight - canvas.clientHeight]; }"""
MEASURED = """
(seconds) => new Promise((done) => {
  const page = window.__viserMutable, { scene } = page, before = scene.onAfterRender;
  let figures = null, pictures = 0;
  scene.onAfterRender = (renderer, ...rest) => {
    before.call(scene, renderer, ...rest);
    const gl = renderer.getContext(), { calls, triangles } = renderer.info.render;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // until it is done
    pictures++;
    figures = { calls, triangles, wide: gl.drawingBufferWidth, high: gl.drawingBufferHeight };
  };
  const start = performance.now();
  const ask = () => {
    if (performance.now() - start < 1000 * seconds || pictures < 6) {
      page.requestRender();
      requestAnimationFrame(ask);
      return;
    }
    scene.onAfterRender = before;
    done({ ...figures, pictures });
  };
  ask();
})
"""


def figures_of(page: Page) -> dict[str, Any]:
    """Return what a picture costs in a page that is drawn."""
    beside: list[int] = page.evaluate(BESIDE)
    page.set_viewport_size({"width": WIDE + beside[0], "height": HIGH + beside[1]})
    page.wait_for_function(f"() => window.__viserMutable.canvas.clientWidth === {WIDE}")
    before = _browser_seconds()
    figures: dict[str, Any] = page.evaluate(MEASURED, SECONDS)
    return figures | {"ms": 1e3 * (_browser_seconds() - before) / figures["pictures"]}


def _browser_seconds() -> float:
    """Return the processor time of the browser's processes until now."""
    running = psutil.Process().children(recursive=True)
    times = [each.cpu_times() for each in running if "chrom" in each.name()]
    return sum(each.user + each.system for each in times)


def opened(page: Page, address: str, scene: str) -> None:
    """Open a scene and wait until it is drawn."""
    page.goto(f"{address}/?scene={scene}&fixedDpr=1")
    page.wait_for_function(DRAWN, timeout=PATIENCE_MS)
    page.locator("#bd-cover").wait_for(state="detached")


def begun(look: str, scene: str) -> dict[str, Any]:
    """Return the figures of a scene as it begins."""
    command = (*PROGRAM, "trainer", "--port", "0", "--look", look)
    with served(*command) as (address, _), browser_page() as page:
        opened(page, address, scene)
        begin = page.get_by_role("button", name="Begin")
        begin.dispatch_event("click")
        begin.wait_for(state="detached")
        return figures_of(page)


def cleared(look: str) -> dict[str, Any]:
    """Return the figures of Calot's triangle once it is cleared."""
    run = CarefulRun.read(RUNS / "critical_view.json.xz").run
    replay = Replay(run.log, shipped_organ())
    replay.seek(CLEARED_S)
    broken = replay.session.reading().broken
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.json"
        file.write_bytes(run_json(run))
        command = (*PROGRAM, "trainer", "--port", "0", "--look", look, "--replay", file)
        with served(*command) as (address, _), browser_page() as page:
            opened(page, address, "calot")
            time = page.get_by_label("Time (s)").locator("visible=true").last
            time.fill(f"{CLEARED_S:g}")
            time.press("Enter")
            readout = page.get_by_test_id("readout")
            expect(readout).to_have_attribute("data-broken", f"{broken}", timeout=PATIENCE_MS)
            return figures_of(page)


def main() -> None:
    """Measure, and print a table in Markdown."""
    console = Console()
    console.print("| scene | look | draw calls | triangles | dots | processor, ms |")
    console.print("|---|---|---|---|---|---|")
    for look in ("full", "plain"):
        for scene in ("calot", "calot, cleared", "bed", "free"):
            each = cleared(look) if scene.endswith("cleared") else begun(look, scene)
            console.print(
                f"| {scene} | {look} | {each['calls']} | {each['triangles']:,} "
                f"| {each['wide']} x {each['high']} | {each['ms']:.0f} |",
                highlight=False,
                soft_wrap=True,
            )


if __name__ == "__main__":
    main()
