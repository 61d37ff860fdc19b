"""Pages in headless Chromium, and what their canvas shows."""

import base64
import io
import shutil
import time

import numpy as np
import pytest
from PIL import Image

SOFTWARE_GL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


def launch(playwright):
    """Chromium with GL in software; skips where there is none."""
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


def watched_tab(browser, address):
    """A loaded page, what went wrong in it, and the addresses it asked for."""
    tab = browser.new_page(viewport={"width": 900, "height": 700})
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
    """Asks from outside: the pages' own rules forbid the browser's way, which evaluates text."""
    end = time.monotonic() + seconds
    while not tab.evaluate(expression):
        assert time.monotonic() < end, f"{expression} did not come true in {seconds} s"
        tab.wait_for_timeout(100)


def canvas(tab):
    """[height, width, 4] what the 3D canvas shows."""
    picture = tab.evaluate("document.getElementById('walk').toDataURL()")
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(picture.split(",")[1]))).convert("RGBA"), int
    )


def drawn(tab, seconds=30):
    """What the canvas shows as soon as it shows something: a model is drawn some time after it has been loaded."""
    end = time.monotonic() + seconds
    while is_blank(picture := canvas(tab)):
        assert time.monotonic() < end, f"the canvas is still blank after {seconds} s"
        tab.wait_for_timeout(100)
    return picture


def is_blank(picture):
    """Whether next to nothing is drawn on the transparent canvas."""
    return (picture[..., 3] > 0).mean() < 0.02 or picture[picture[..., 3] > 0][:, :3].std() < 5
