"""All that goes beyond viser's public interface: private names, the page's style, scripts and HTML.

viser has no call for what is here. Each part says what viser lacks, and `test_viser_bridge` has a
test of each that fails with a clear message if another version of viser breaks it.
"""

from app.trainer.viser_bridge.page import (
    announce,
    asked_by_address,
    closer_html,
    command_number,
    keep_in_sight,
    kept_by_tab,
    letter_keys_on,
    offer_home,
    open_tab,
    pairs_html,
    prepare_page,
    run_in_page,
    set_arrow_step,
    set_letter_keys,
    tab_keeps,
    take_arrows,
    watch_pace,
)
from app.trainer.viser_bridge.page_messages import page_message_decoder, viser_message
from app.trainer.viser_bridge.private_api import (
    close_page,
    connection_of,
    hand_over,
    page_of,
    place_node,
    read_icons,
    set_plot,
    start_server,
    stop_server,
    stream,
    wakes_once,
)
from app.trainer.viser_bridge.recording import recording_page, write_caption

__all__ = [
    "announce",
    "asked_by_address",
    "close_page",
    "closer_html",
    "command_number",
    "connection_of",
    "hand_over",
    "keep_in_sight",
    "kept_by_tab",
    "letter_keys_on",
    "offer_home",
    "open_tab",
    "page_message_decoder",
    "page_of",
    "pairs_html",
    "place_node",
    "prepare_page",
    "read_icons",
    "recording_page",
    "run_in_page",
    "set_arrow_step",
    "set_letter_keys",
    "set_plot",
    "start_server",
    "stop_server",
    "stream",
    "tab_keeps",
    "take_arrows",
    "viser_message",
    "wakes_once",
    "watch_pace",
    "write_caption",
]
