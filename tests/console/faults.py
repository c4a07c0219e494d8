"""What must hold of a record after people with phones have run a study: nothing lost, nothing twice, no arm named."""

from datetime import timedelta

from tests.console.operators import Operators
from tests.console.rehearsal import TELLING


def faults(people: Operators) -> list[str]:
    """Return everything that is not as it must be, by the record and by what the phones saw."""
    run, phones = people.run, people.phones
    found = []
    results = dict(run.rows("SELECT trial_id, COUNT(*) FROM episode WHERE state = 'judged' GROUP BY trial_id"))
    planned = [number for (number,) in run.rows("SELECT trial_id FROM study_trial")]
    if sorted(results) != sorted(planned) or set(results.values()) != {1}:
        found.append(f"{len(results)} of {len(planned)} trials have a result, {max(results.values())} the most")
    if len(planned) != run.trials:
        found.append(f"{len(planned)} trials were planned, not {run.trials}")
    states = {state for (state,) in run.rows("SELECT DISTINCT state FROM episode")}
    if states - {"judged", "void"}:
        found.append(f"left in the record: {states}")
    found += _lost_or_twice(people)
    for phone in phones:
        found += [f"{phone.name}: {error}" for error in phone.errors]
        found += [f"{phone.name} asked {address}" for address in phone.elsewhere]
        found += [f"{phone.name} was told: {said!r}" for said in phone.relay.heard]
        if TELLING.search(phone.told_of_cookies()):
            found.append(f"a cookie of {phone.name} names an arm")
    if TELLING.search(run.log.read_bytes()):
        found.append("the terminal names an arm")
    return found


def _lost_or_twice(people: Operators) -> list[str]:
    found = []
    query = "SELECT note, author, success, distance_m, created_at FROM verdict WHERE source = 'person'"
    kept: dict[str, list[tuple]] = {}
    for note, *rest in people.run.rows(query):
        kept.setdefault(note, []).append(tuple(rest))
    words = {said.note: said for said in people.said}
    found += [f"nobody said {note!r}" for note in kept.keys() - words.keys()]
    found += [f"{note!r} is there {len(rows)} times" for note, rows in kept.items() if len(rows) > 1]
    for phone in people.phones:
        for asked in phone.asked:
            if asked.path not in ("/judge", "/amend") or asked.status != 200:
                continue
            note = asked.body["note"]
            if note not in kept:
                found.append(f"lost: {asked}")
                continue
            author, success, _, at = kept[note][0]
            if author != phone.name or success != words[note].success:
                found.append(f"{asked} became {kept[note][0]}")
            since, until = asked.at - timedelta(seconds=1), asked.answered_at + timedelta(seconds=1)
            if not f"{since:%Y-%m-%d %H:%M:%S}" <= str(at) <= f"{until:%Y-%m-%d %H:%M:%S.%f}":
                found.append(f"{asked} is of {at}")
    by_a_button = "SELECT COUNT(*) FROM event WHERE kind = 'intervention' AND text LIKE 'stopped with the page%'"
    if people.run.rows(by_a_button)[0][0] < people.stopped:
        found.append("a STOP that a phone confirmed is not in the record")
    return found
