"""Runs a blind study of two arms on two phones, with kills, reloads and network failures.

    python scripts/console_trials.py --trials 3
    python scripts/console_trials.py --trials 75 --seed 7 --keep DIRECTORY

Two Chromium pages of 390 x 844 pixels, each through its own relay, use `vsnbench study run` with a rehearsal robot. At
every screen the run is killed and continues at the same address, the page is reloaded, the phone loses its network
while a button is pressed, and both phones press a button at the same time: 24 disturbances, which all happen in 12 or
more trials. Afterwards the database must contain every trial once, and every confirmed answer once with its author and
time. No byte sent to a browser may reveal an arm, and the browser must contact no other host. The exit code is 1
otherwise, or if a disturbance did not happen.
"""

import argparse
import random
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.web.blind_study import BlindStudy
from tests.web.phone_operators import phone_operators, schedule
from tests.web.study_faults import study_faults


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--trials", type=int, default=75)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--keep", type=Path, help="a new directory for the study and its record")
    arguments = options.parse_args()
    chance = random.Random(arguments.seed)
    disturbances = schedule(arguments.trials, chance)
    with ExitStack() as stack:
        directory = arguments.keep or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        directory.mkdir(parents=True, exist_ok=arguments.keep is None)
        study = stack.enter_context(BlindStudy(directory, arguments.trials, arguments.seed))
        study.study("lock", "--force")
        operators = stack.enter_context(phone_operators(study, chance, disturbances))
        began = time.monotonic()
        operators.log = lambda text: print(f"{time.monotonic() - began:5.0f} s  {text}", file=sys.stderr, flush=True)
        operators.run_session()
        took_s = time.monotonic() - began
        wrong = study_faults(operators)
        confirmed = sum(request.status == 200 for phone in operators.phones for request in phone.requests)
        late = sum(request.status == 409 for phone in operators.phones for request in phone.requests)
        received = sum(phone.relay.received for phone in operators.phones)
        print(f"{arguments.trials} trials in {took_s:.0f} s, exit code {study.code}")
        print(f"{study.kills} kills; disturbances: {dict(sorted(operators.happened.items()))}")
        print(f"did not happen: {disturbances}" if disturbances else "all disturbances happened")
        print(f"{confirmed} answers confirmed, {late} too late, {received / 1e6:.1f} MB searched")
        print(f"{operators.stopped} episodes ended with STOP; {len(operators.judgements)} judgements tried")
        print("\n".join(wrong) or "nothing lost or duplicated, no arm revealed")
        return 1 if wrong or disturbances or study.code != 0 else 0


if __name__ == "__main__":
    sys.exit(main())
