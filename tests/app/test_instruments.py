"""What pages and pictures know of instruments: of each, or it fails in a trainee's hand."""

from pathlib import Path

import app
from app.rl.picture import SHAFTS
from app.simulation import ALL_INSTRUMENTS, INSTRUMENTS
from app.simulation.tissue.instruments import RODS
from app.trainer.client.scope_lead import LEAD_MM_S
from app.trainer.panel import hands_box, scope_panel

PICTURE = Path(app.__path__[0]) / "trainer" / "scope" / "page" / "instruments.js"


def test_every_instrument_is_known_wherever_it_is_taken() -> None:
    for table in (RODS, LEAD_MM_S, scope_panel.HOW, SHAFTS):
        assert set(table) == set(ALL_INSTRUMENTS)
    for table in (hands_box.OFFERED, hands_box.HOW):
        assert set(table) == set(INSTRUMENTS)
    kinds = PICTURE.read_text().partition("const KINDS = {")[2].partition("};")[0]
    drawn = {line.split(":")[0].strip().strip('"') for line in kinds.splitlines() if ":" in line}
    assert drawn == set(ALL_INSTRUMENTS)
