"""Takes docs/figures/episode-view.png: an episode in Rerun's web viewer, in a headless Chromium.

usage: python scripts/screenshot_view.py RESULTS EPISODE PNG   (from the top of the checkout)
"""

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.cli.chromium import Chromium
from vsnbench.record.results import ResultsDirectory
from vsnbench.viewer.rebuild import current_recording
from vsnbench.viewer.viewers import WebViewer

STILL_FOR_S = 12.0
PATIENCE_S = 120.0


def main(results: str, episode: str, png: str) -> None:
    """Wait until the page stands still, then keep it."""
    recording = current_recording(ResultsDirectory.locate(Path(results)), int(episode))
    with (
        WebViewer(0, recording) as viewer,
        tempfile.TemporaryDirectory() as profile,
        Chromium(Path(profile), 1600, 1000) as browser,
    ):
        browser.open(f"{viewer.address}?renderer=webgl")
        began = changed = time.monotonic()
        picture = b""
        while time.monotonic() - changed < STILL_FOR_S and time.monotonic() - began < PATIENCE_S:
            time.sleep(1)
            if (now := browser.screenshot()) != picture:
                picture, changed = now, time.monotonic()
    Path(png).write_bytes(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
