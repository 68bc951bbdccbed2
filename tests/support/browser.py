"""A page in headless Chromium: what a visitor sees and does."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.common.exceptions import TimeoutException as TimeoutException
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader")
FLAGS += ("--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


class Page:
    """A page that is open."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def open(self, address: str) -> None:
        self.driver.get(address)

    def image(self, path: Path | None = None) -> np.ndarray:
        """Return what the window shows, shape [row column 3], after drawing is done."""
        image = Image.open(io.BytesIO(self.driver.get_screenshot_as_png())).convert("RGB")
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
            image.save(path)
        return np.asarray(image)

    def text(self) -> str:
        return self.driver.find_element(By.TAG_NAME, "body").text

    def press(self, caption: str) -> None:
        """Click the button or tab with this caption, or one that begins so."""
        path = (
            f"//*[self::button or @role='tab'][starts-with(translate(normalize-space(.), '\u2003', ''), '{caption}')]"
        )
        self.driver.find_element(By.XPATH, path).click()

    def tick(self, caption: str) -> None:
        """Click the checkbox with this caption."""
        self._input(caption).click()

    def type(self, caption: str, value: float) -> None:
        """Write a number into the box beside the slider with this caption."""
        box = self._row(caption).find_element(By.XPATH, ".//input[@type='text' or @inputmode]")
        box.send_keys(Keys.CONTROL, "a")
        box.send_keys(f"{value:g}", Keys.TAB)

    def click(self, x: float, y: float) -> None:
        """Click a place in the window [pixel]."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            event = {
                "type": kind,
                "x": x,
                "y": y,
                "button": "left" if kind != "mouseMoved" else "none",
                "clickCount": 1,
            }
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)
            time.sleep(0.1)

    def drag(self, start: np.ndarray, end: np.ndarray, steps: int = 5) -> None:
        """Drag from one place in the window to another with the shift key down [pixel]."""
        shift = {"key": "Shift", "code": "ShiftLeft", "windowsVirtualKeyCode": 16}
        self.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyDown", "modifiers": 8, **shift})
        path = [("mouseMoved", start, 0), ("mousePressed", start, 1)]
        path += [("mouseMoved", start + (end - start) * (i + 1) / steps, 1) for i in range(steps)]
        for kind, (x, y), buttons in [*path, ("mouseReleased", end, 0)]:
            button = "left" if buttons or kind == "mouseReleased" else "none"
            event = {"type": kind, "x": float(x), "y": float(y), "button": button, "buttons": buttons, "clickCount": 1}
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event | {"modifiers": 8})
            time.sleep(0.05)
        self.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": "keyUp", **shift})

    def value(self, caption: str) -> str:
        """Return what the field with this caption holds."""
        return self._input(caption).get_attribute("value") or ""

    def wait(self, done: Callable[[], bool], seconds: float) -> float:
        """Wait until something is true; return how long that took [s]."""
        start = time.monotonic()
        while not done():
            if time.monotonic() - start > seconds:
                raise TimeoutError(f"not within {seconds:g} s: {self.text()[:500]}")
            time.sleep(0.05)
        return time.monotonic() - start

    def errors(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]

    def _label(self, caption: str):
        return self.driver.find_element(By.XPATH, f"//label[normalize-space(.)='{caption}']")

    def _row(self, caption: str):
        return self._label(caption).find_element(By.XPATH, "./ancestor::div[contains(@class, 'Flex')][1]")

    def _input(self, caption: str):
        return self._row(caption).find_element(By.TAG_NAME, "input")


@contextmanager
def browser(width: int = 1280, height: int = 800) -> Iterator[Page]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--window-size={width},{height}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )
    try:
        yield Page(driver)
    finally:
        driver.quit()


def pixel(point: np.ndarray, eye: np.ndarray, target: np.ndarray, fov: float, size: tuple[int, int]) -> np.ndarray:
    """Return where a view of the scene of some size (width, height) shows a point [pixel]: x, y."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    offset = np.asarray(point) - eye
    plane = np.array([offset @ right, -offset @ np.cross(right, forward)]) / (offset @ forward)
    return np.array([size[0] / 2, size[1] / 2]) + plane * size[1] / 2 / np.tan(fov / 2)


def assert_readable(page: Page, width: int) -> None:
    """Assert that all text of the panel lies within the window, and no caption over another."""
    boxes = page.driver.execute_script(
        "return [...document.querySelectorAll('label, button, td')].filter(e => e.innerText.trim())"
        ".map(e => { const r = e.getBoundingClientRect();"
        " return [r.left, r.top, r.right, r.bottom, e.scrollWidth - e.clientWidth] })"
    )
    boxes = np.array([box for box in boxes if box[2] > box[0]])
    assert len(boxes) > 5
    assert (boxes[:, :2] >= 0).all() and (boxes[:, 2] <= width).all() and (boxes[:, 4] <= 1).all()
    for i, one in enumerate(boxes):
        for other in boxes[i + 1 :]:
            inside = np.minimum(one[2:4], other[2:4]) - np.maximum(one[:2], other[:2])
            assert (inside <= 1.0).any()
