"""A photograph for the record: what the page's camera saw, as the page has sent it."""

import base64
import binascii

MOST_BYTES = 75_000
LONGEST = 100_000  # characters, as a page may send
KINDS = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}


def kind_of(content: bytes) -> str | None:
    """Return an image's media type by its first bytes: WebP, PNG or JPEG; None of anything else."""
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return "image/webp"
    return next((kind for start, kind in KINDS.items() if content.startswith(start)), None)


def photograph_of(url: object) -> bytes:
    """Return the image in a data URL; a `ValueError` if it is none, or too large."""
    if not isinstance(url, str) or len(url) > LONGEST or not url.startswith("data:image/"):
        raise ValueError("The page has sent no picture.")
    try:
        content = base64.b64decode(url.partition(";base64,")[2], validate=True)
    except (binascii.Error, ValueError):
        content = b""
    if not 0 < len(content) <= MOST_BYTES or kind_of(content) is None:
        raise ValueError("The page has sent no picture.")
    return content
