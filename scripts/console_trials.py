"""Runs a blind study of two arms to its end by clicks on two phones, while everything goes wrong that can.

    python scripts/console_trials.py --trials 3
    python scripts/console_trials.py --trials 75 --seed 7 --keep DIRECTORY

Two pages of 390 x 844 pixels in a real Chromium, each through a relay of its own, at `vsnbench study run` with a
rehearsal's robot. At every screen, from signing in to the end, the run is killed with SIGKILL and goes on at the same
address, the page is reloaded, the phone loses its network with its thumb on a button, and both phones press at the same
moment: 24 mishaps, all of which happen in 12 trials or more. Afterwards the record must hold every trial once, every
answer that a page confirmed with its author and time, and nothing twice; no byte that the run said to a browser names
an arm; and the browser asked nobody but the run. Exits with 1 where it is not so, or where a mishap was not come to.
"""

import argparse
import random
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.console.faults import faults
from tests.console.operators import operators_at, schedule
from tests.console.rehearsal import Rehearsal


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--trials", type=int, default=75)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--keep", type=Path, help="a new directory for the study and its record")
    asked = options.parse_args()
    chance = random.Random(asked.seed)
    mishaps = schedule(asked.trials, chance)
    with ExitStack() as stack:
        directory = asked.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        directory.mkdir(parents=True, exist_ok=asked.keep is None)
        run = stack.enter_context(Rehearsal(directory, asked.trials, asked.seed))
        run.study("lock")
        people = stack.enter_context(operators_at(run, chance, mishaps))
        began = time.monotonic()
        people.tell = lambda words: print(f"{time.monotonic() - began:5.0f} s  {words}", file=sys.stderr, flush=True)
        people.attend()
        took_s = time.monotonic() - began
        wrong = faults(people)
        confirmed = sum(one.status == 200 for phone in people.phones for one in phone.asked)
        late = sum(one.status == 409 for phone in people.phones for one in phone.asked)
        carried = sum(phone.relay.carried for phone in people.phones)
        print(f"{asked.trials} trials in {took_s:.0f} s, {took_s / asked.trials:.1f} s each; exit code {run.code}")
        print(f"{run.kills} kills; what happened: {dict(sorted(people.happened.items()))}")
        print(f"not come to: {mishaps}" if mishaps else "everything that was to happen did")
        print(f"{confirmed} answers confirmed, {late} told they were late, {carried / 1e6:.1f} MB looked through")
        print(f"{people.stopped} episodes ended with STOP; {len(people.said)} judgements tried")
        print("\n".join(wrong) or "nothing lost, nothing twice, no arm named")
        return 1 if wrong or mishaps or run.code != 0 else 0


if __name__ == "__main__":
    sys.exit(main())
