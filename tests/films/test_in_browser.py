"""Films in a real browser: both codecs play, in the pictures' own colours."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from openswim.films.video import write_video

COLOURS = [(200, 60, 40), (30, 90, 200), (128, 128, 128), (20, 160, 70), (250, 250, 250), (5, 5, 5), (240, 210, 90)]
SIZES = {"small": (64, 96), "720p": (720, 1280)}  # players guess a matrix by the size where none is told
# Colours are converted on the graphics card, here in software. Without one libyuv does it, whose factor from Cb to blue
# is 2 in place of 2.112, as it holds it in 8 bits: at (30, 90, 200), where Cb is 182, that is 6 too little
PATHS = {
    "graphics": (["--use-angle=swiftshader", "--enable-unsafe-swiftshader"], 1),
    "none": (["--disable-gpu"], 7),
}
_OPENED = """async source => {
  const video = document.createElement('video');
  document.body.style.margin = 0;
  document.body.replaceChildren(video);
  video.muted = true;
  video.src = source;
  await new Promise((ready, failed) => {
    video.onloadeddata = ready;
    video.onerror = () => failed(video.error.message);
  });
  return [video.duration, video.videoWidth, video.videoHeight];
}"""
_AT = """async time => {
  const video = document.querySelector('video');
  video.currentTime = time;
  await new Promise(ready => { video.onseeked = ready; });
  await new Promise(ready => requestAnimationFrame(() => requestAnimationFrame(ready)));
}"""


@pytest.fixture(scope="module", params=list(PATHS))
def page(request: pytest.FixtureRequest) -> Iterator[tuple[Any, int]]:
    """A page, and how far off colours may be."""
    browsers = pytest.importorskip("playwright.sync_api", reason="the browser is driven by playwright")
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium is installed here to play films in")
    with browsers.sync_playwright() as driver:
        options, bound = PATHS[request.param]
        arguments = ["--no-sandbox", "--force-color-profile=srgb", *options]
        browser = driver.chromium.launch(executable_path=found, args=arguments)
        yield browser.new_page(), bound
        browser.close()


@pytest.mark.parametrize("size", list(SIZES))
@pytest.mark.parametrize(("suffix", "kind"), [(".mp4", "video/mp4"), (".webm", "video/webm")])
def test_chromium_shows_every_colour_within_a_step(
    page: tuple[Any, int], tmp_path: Path, suffix: str, kind: str, size: str
) -> None:
    pytest.importorskip("av")
    shown_on, bound = page
    path = tmp_path / f"film{suffix}"
    pictures = (np.broadcast_to(np.array(colour, np.uint8), (*SIZES[size], 3)) for colour in COLOURS)
    write_video(path, pictures, 4, "title", "comment")
    source = f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
    seconds, width, height = shown_on.evaluate(_OPENED, source)
    assert (height, width) == SIZES[size]
    assert seconds == pytest.approx(len(COLOURS) / 4, abs=0.05)
    found = []
    for n in range(len(COLOURS)):
        shown_on.evaluate(_AT, (n + 0.5) / 4)
        shown = Image.open(BytesIO(shown_on.screenshot())).convert("RGB")
        found.append(shown.getpixel((width // 2, height // 2)))
    off = np.abs(np.array(found) - np.array(COLOURS)).max(axis=1)
    assert off.max() <= bound, off
