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
COLOURS += [(60, 120, 220), (90, 150, 230), (0, 0, 0), (255, 255, 255), (120, 40, 10)]
# players guess a matrix by the size where none is told; how often all colours come
SIZES = {"small": (64, 96, 4), "720p": (720, 1280, 1)}
# Colours are converted on the graphics card, here in software, or without one by libyuv
PATHS = {"graphics": ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"], "none": ["--disable-gpu"]}
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
def page(request: pytest.FixtureRequest) -> Iterator[Any]:
    browsers = pytest.importorskip("playwright.sync_api", reason="the browser is driven by playwright")
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium is installed here to play films in")
    with browsers.sync_playwright() as driver:
        arguments = ["--no-sandbox", "--force-color-profile=srgb", *PATHS[request.param]]
        browser = driver.chromium.launch(executable_path=found, args=arguments)
        yield browser.new_page()
        browser.close()


@pytest.mark.parametrize("size", list(SIZES))
@pytest.mark.parametrize(("suffix", "kind"), [(".mp4", "video/mp4"), (".webm", "video/webm")])
def test_chromium_shows_every_frame_in_its_colours(
    page: Any, tmp_path: Path, suffix: str, kind: str, size: str
) -> None:
    pytest.importorskip("av")
    path = tmp_path / f"film{suffix}"
    *shape, times = SIZES[size]
    colours = COLOURS * times  # 48 frames
    write_video(
        path, (np.broadcast_to(np.array(each, np.uint8), (*shape, 3)) for each in colours), 4, "title", "comment"
    )
    source = f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
    seconds, width, height = page.evaluate(_OPENED, source)
    assert [height, width] == shape
    assert seconds == pytest.approx(len(colours) / 4, abs=0.05)
    found = []
    for n in range(len(colours)):
        page.evaluate(_AT, (n + 0.5) / 4)
        clip = {"x": width // 2, "y": height // 2, "width": 2, "height": 2}
        shown = Image.open(BytesIO(page.screenshot(clip=clip))).convert("RGB")
        found.append(shown.getpixel((0, 0)))
    off = np.abs(np.array(found) - np.array(colours)).max(axis=1)
    assert off.max() <= 4, off
