"""Takes docs/figures/console/*.webp: every step of the operator's page at phone size, light beside dark.

usage: python scripts/console_screens.py [DIRECTORY]   (some two minutes on a busy machine)

A rehearsal in the embedded apartment is run by clicks; two phones, one of them dark, see the same. Placed, measured,
driven, judged, asked back, corrected, cut off, ended: what is on the screen at each step is kept.
"""

import os
import random
import re
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.console.phone import Phone, Said, chromium_of_phones, phone_in
from tests.console.rehearsal import quiet_port, wait_until
from tests.console.tcp_relay import TcpRelay

ROOT = Path(__file__).resolve().parent.parent
SCALE = 1.5
QUALITY = 60
UNHURRIED = '''"""The oracle at a real robot's pace, so that it can be watched."""
import time
from vsnbench.models.oracle import Oracle as Hurried

class Oracle(Hurried):
    def act(self, observation):
        time.sleep(0.4)
        return super().act(observation)
'''
WORDS = (
    "--model",
    "unhurried:Oracle",
    "--goal",
    "chair",
    "--starts",
    "3",
    "--pretend-real",
    "--robot",
    "simulated:lola2",
)


class Screens:
    """Two phones that see the same, and what they showed."""

    def __init__(self, phones: list[Phone], folder: Path) -> None:
        self._phones = phones
        self._folder = folder

    def keep(self, name: str, look_at: str = "") -> None:
        """Write what both show, side by side; scrolled to something where that is named."""
        shown = []
        for phone in self._phones:
            if look_at:
                phone.page.locator(look_at).first.evaluate("one => one.scrollIntoView({ block: 'center' })")
            phone.page.wait_for_timeout(300)
            shown.append(cv2.imdecode(np.frombuffer(phone.page.screenshot(), np.uint8), cv2.IMREAD_COLOR))
        gap = np.full((shown[0].shape[0], 24, 3), 255, np.uint8)
        file = self._folder / f"{name}.webp"
        cv2.imwrite(str(file), np.hstack([shown[0], gap, shown[1]]), [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
        print(f"{file.name}  {file.stat().st_size / 1000:.0f} kB", flush=True)


def main(folder: Path) -> None:
    """Run the rehearsal."""
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        port = quiet_port(random.Random())
        log = directory / "log"
        command = [sys.executable, "-m", "vsnbench.cli.main", "run", *WORDS, "--console-port", str(port)]
        (directory / "unhurried.py").write_text(UNHURRIED)
        path = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(directory)])}
        with log.open("w") as sink:
            results = ["--results", str(directory / "results")]
            run = subprocess.Popen([*command, *results], cwd=ROOT, stderr=sink, stdin=-3, env=path)
        stack.callback(run.wait)
        stack.callback(run.kill)
        wait_until(lambda: run.poll() is not None or "token=" in log.read_text(), "the page is served")
        found = re.search(r"http://\S+token=\S+", log.read_text())
        assert found is not None, log.read_text()
        relay = stack.enter_context(TcpRelay(port))
        hosts = ("127.0.0.1", "localhost")
        browser = stack.enter_context(chromium_of_phones(*((host, relay, port) for host in hosts)))
        looks = zip(("Anna", "Ben"), hosts, ("light", "dark"), strict=True)
        phones = [
            phone_in(browser, name, host, relay, found[0], color_scheme=look, device_scale_factor=SCALE)
            for name, host, look in looks
        ]
        by_clicks(phones, Screens(phones, folder), relay)


def by_clicks(phones: list[Phone], screens: Screens, relay: TcpRelay) -> None:
    """Do one trial, and keep each screen of it."""
    anna, ben = phones

    def both(selector: str) -> None:
        for phone in phones:
            phone.page.wait_for_selector(selector, state="visible")

    for phone in phones:
        phone.page.goto(phone.address)
        phone.page.wait_for_selector("#name", state="visible")
    screens.keep("1-sign-in")
    for phone in phones:
        phone.sign_in()
    both("#plan svg")
    both("#check")
    screens.keep("2-next-trial")
    anna.page.click("#check")
    both("#placement")
    screens.keep("3-measured", "#placement")
    screens.keep("3-what-it-should-see", ".overlay")
    for _ in range(8):
        if "good" in str(anna.page.get_attribute("#placement", "class")):
            break
        key = anna.page.locator(".overlay img").first.get_attribute("src")
        anna.page.click("#moved")
        anna.page.wait_for_selector(f"#placement, .overlay img:not([src='{key}'])")
        anna.page.wait_for_function("() => !document.getElementById('go').disabled")
    both("#placement")
    screens.keep("4-it-stands-there", "#go")
    anna.page.click("#go")
    both("#picture img[src^=blob]")
    anna.page.wait_for_function("() => document.getElementById('driving-steps').textContent.length > 8")
    screens.keep("5-driving")
    relay.stall()
    both("#offline")
    screens.keep("6-no-link")
    relay.mend(cut=True)
    for phone in phones:
        phone.page.wait_for_selector("#offline", state="hidden")
    both("#judging .judging-form")
    screens.keep("7-what-happened")
    for phone in phones:
        phone.fill_judgement("#judging", Said("", distance="4 m"))
    anna.confirm("#judging", Said(""))
    ben.confirm("#judging", Said(""))
    both("#ask")
    screens.keep("8-asked-back")
    for phone in phones:
        phone.page.click("#ask [value=no]")
        phone.fill_judgement("#judging", Said("", distance="0.84"))
    anna.confirm("#judging", Said(""))
    both("#finish")
    for phone in phones:
        if not phone.page.locator("#episodes").is_visible():
            phone.page.click("#episodes-card summary")
    both(".episode [data-amend]")
    screens.keep("9-the-end")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "figures" / "console")
