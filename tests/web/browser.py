"""Pages in headless Chromium, and what their canvas shows."""

import base64
import io
import re
import shutil
import time

import numpy as np
import pytest
from PIL import Image

SOFTWARE_GL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]

FEWER_SAMPLES = """
const { prototype } = WebGL2RenderingContext, { shaderSource } = prototype;
prototype.shaderSource = function (shader, text) {
  shaderSource.call(this, shader, text.replace("GGX_SAMPLES 256", "GGX_SAMPLES 4"));
};
"""
"""The viewer blurs the light of its surroundings once; with software GL, 256 samples take 10 s."""


def launch(playwright):
    """Chromium with software GL; skips without Chromium."""
    program = next(
        (
            found
            for name in ("chromium", "chromium-browser", "google-chrome")
            if (found := shutil.which(name))
        ),
        None,
    )
    if program is None:
        pytest.skip("needs Chromium (apt: chromium)")
    return playwright.chromium.launch(executable_path=program, args=SOFTWARE_GL)


COARSE = {"device_scale_factor": 0.5}
"""A quarter of the pixels in the same layout: software GL takes more than a core for all of them."""


def new_tab(browser, width, height, **settings):
    """An empty tab, in which a page of the viewer is drawn soon."""
    tab = browser.new_page(viewport={"width": width, "height": height}, **COARSE | settings)
    tab.add_init_script(FEWER_SAMPLES)
    return tab


def watched_tab(browser, address, **settings):
    """A loaded page, its errors, and the addresses it requested."""
    tab = new_tab(browser, 900, 700, **settings)
    wrong, asked = [], []
    tab.on(
        "console", lambda message: wrong.append(message.text) if message.type == "error" else None
    )
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(address)
    wait_until(tab, "document.getElementById('walk')?.loaded")
    return tab, wrong, asked


def wait_until(tab, expression, seconds=60):
    """Poll from outside: the pages' rules forbid the browser's own way, which evaluates text."""
    end = time.monotonic() + seconds
    while not tab.evaluate(expression):
        assert time.monotonic() < end, f"{expression} did not come true in {seconds} s"
        tab.wait_for_timeout(100)


PHONE = {"has_touch": True, "is_mobile": True}
"""Settings of a tab on a device with a touch screen."""


def lightness(tab):
    """Lightness 0 to 1 of a page's background and of its text."""
    colours = tab.evaluate(
        "[[document.body, 'backgroundColor'], [document.querySelector('h1'), 'color']]"
        ".map(([element, what]) => getComputedStyle(element)[what])"
    )
    return [np.mean([int(part) for part in re.findall(r"\d+", text)[:3]]) / 255 for text in colours]


def check_dark(tab):
    """Check a page that was loaded dark: its text is light, and it is light where that is wanted."""
    for scheme, dark in (("dark", True), ("light", False)):
        tab.emulate_media(color_scheme=scheme)
        paper, ink = lightness(tab)
        assert (paper < 0.2, ink > 0.7) == (dark, dark), scheme


def canvas(tab):
    """Pixels [height, width, 4] of the 3D canvas."""
    picture = tab.evaluate("document.getElementById('walk').toDataURL()")
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(picture.split(",")[1]))).convert("RGBA"), int
    )


def drawn(tab, seconds=30):
    """First pixels that are not blank: a model is drawn some time after it is loaded."""
    end = time.monotonic() + seconds
    while is_blank(picture := canvas(tab)):
        assert time.monotonic() < end, f"the canvas is still blank after {seconds} s"
        tab.wait_for_timeout(100)
    return picture


def is_blank(picture):
    """Whether the transparent canvas is nearly empty."""
    return (picture[..., 3] > 0).mean() < 0.02 or picture[picture[..., 3] > 0][:, :3].std() < 5
