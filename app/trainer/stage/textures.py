"""Procedural textures: smooth noise, colour ramps, normal maps and their JPEG files."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
"""(H, W) or (H, W, 3) picture; colours are sRGB, 0 to 255, as red, green, blue."""


def smooth_noise(shape: tuple[int, int], *, cells: float, fall: float, seed: int) -> Image:
    """Return periodic noise about 0.5 with most values between 0 and 1."""
    rows, columns = shape
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal(shape))
    frequency = np.hypot(
        np.fft.fftfreq(rows, 1.0 / rows)[:, None], np.fft.rfftfreq(columns, 1.0 / columns)[None]
    )
    weight = np.where(frequency < cells, 0.0, np.maximum(frequency, 1.0) ** -fall)
    noise = np.fft.irfft2(spectrum * weight, shape)
    noise = (noise - noise.mean()) / noise.std()
    return np.clip(0.5 + noise / 5.0, 0.0, 1.0).astype(np.float32)


def noise_at(x: Image, y: Image, *, length: float, cells: float, fall: float, seed: int) -> Image:
    """Return noise at x, y, mm, periodic over `length` mm; the same for dense and sparse points."""
    size = 512
    tile = np.pad(smooth_noise((size, size), cells=cells, fall=fall, seed=seed), 1, mode="wrap")
    column, row = (
        (np.mod(place / length, 1.0) * size + 1.0).astype(np.float32) for place in (x, y)
    )
    return cv2.remap(tile, column, row, cv2.INTER_LINEAR).astype(np.float32)


def smooth_step(values: Image, low: float, high: float) -> Image:
    """Return 0 below `low`, 1 above `high` and a smooth ramp between; falling if `high` < `low`.

    Returns
    -------
    Image
        The shape of `values`.

    Examples
    --------
    >>> smooth_step(np.float32([0, 1, 2, 3]), 1.0, 2.0).tolist()
    [0.0, 0.0, 1.0, 1.0]
    """
    t = np.clip((values - low) / (high - low), 0.0, 1.0)
    return (t * t * (3.0 - 2.0 * t)).astype(np.float32)


def mixed_color(
    under: Image | Sequence[int], over: Image | Sequence[int], fraction: Image
) -> Image:
    """Return two colours or pictures mixed pixel by pixel; `fraction` is that of `over`, 0 to 1."""
    amount = fraction[..., None]
    return (
        np.asarray(under, np.float32) * (1.0 - amount) + np.asarray(over, np.float32) * amount
    ).astype(np.float32)


def blurred(picture: Image, radius: float) -> Image:
    """Return the picture under a Gaussian blur of standard deviation `radius`, px."""
    return cv2.GaussianBlur(picture, (0, 0), radius).astype(np.float32)


def normal_map(height: Image, relief: float) -> Image:
    """Return the tangent-space normals of a height picture as colours."""
    right = cv2.Sobel(height, cv2.CV_32F, 1, 0, ksize=3) * (relief / 8.0)
    down = cv2.Sobel(height, cv2.CV_32F, 0, 1, ksize=3) * (relief / 8.0)
    normals = np.stack([-right, down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return (normals * 127.5 + 127.5).astype(np.float32)


def jpeg_file(picture: Image, *, quality: int) -> bytes:
    """Return a picture as a JPEG file."""
    pixels = np.clip(picture, 0.0, 255.0).round().astype(np.uint8)[..., ::-1]
    written, file = cv2.imencode(
        ".jpg", np.ascontiguousarray(pixels), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    if not written:
        raise ValueError(f"picture must be a colour image, got shape {picture.shape}")
    return file.tobytes()
