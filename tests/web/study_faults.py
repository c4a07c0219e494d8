"""Checks of the results after a study by phone: nothing lost or duplicated, no arm revealed."""

from datetime import timedelta

from tests.web.blind_study import ARM_NAMES
from tests.web.phone_operators import PhoneOperators


def study_faults(operators: PhoneOperators) -> list[str]:
    """Return all faults in the database, and in what the phones received."""
    run, phones = operators.study, operators.phones
    found = []
    results = dict(run.rows("SELECT trial_id, COUNT(*) FROM episode WHERE state = 'judged' GROUP BY trial_id"))
    planned = [number for (number,) in run.rows("SELECT trial_id FROM study_trial")]
    if sorted(results) != sorted(planned) or set(results.values()) != {1}:
        most = max(results.values(), default=0)
        ends = run.rows("SELECT state, COUNT(*), MAX(error) FROM episode GROUP BY state")
        log = f"{ends}, exit {run.code}: {run.log.read_text()[-1000:]}"
        found.append(f"{len(results)} of {len(planned)} trials have a result, {most} the most; the run logged: {log}")
    if len(planned) != run.trials:
        found.append(f"{len(planned)} trials were planned, not {run.trials}")
    states = {state for (state,) in run.rows("SELECT DISTINCT state FROM episode")}
    if states - {"judged", "void"}:
        found.append(f"unfinished episodes: {states}")
    found += _lost_or_duplicated(operators)
    for phone in phones:
        found += [f"{phone.name}: {error}" for error in phone.errors]
        found += [f"{phone.name} contacted {address}" for address in phone.other_hosts]
        found += [f"{phone.name} received {match!r}" for match in phone.relay.matches]
        if ARM_NAMES.search(phone.cookies()):
            found.append(f"a cookie of {phone.name} reveals an arm")
    if ARM_NAMES.search(run.log.read_bytes()):
        found.append("the terminal reveals an arm")
    return found


def _lost_or_duplicated(operators: PhoneOperators) -> list[str]:
    found = []
    query = "SELECT note, author, success, distance_m, created_at FROM verdict WHERE source = 'person'"
    recorded: dict[str, list[tuple]] = {}
    for note, *rest in operators.study.rows(query):
        recorded.setdefault(note, []).append(tuple(rest))
    expected = {judgement.note: judgement for judgement in operators.judgements}
    found += [f"unknown judgement {note!r}" for note in recorded.keys() - expected.keys()]
    found += [f"{note!r} is recorded {len(rows)} times" for note, rows in recorded.items() if len(rows) > 1]
    for phone in operators.phones:
        for request in phone.requests:
            if request.path not in ("/judge", "/amend") or request.status != 200:
                continue
            note = request.body["note"]
            if note not in recorded:
                found.append(f"lost: {request}")
                continue
            author, success, _, at = recorded[note][0]
            if author != phone.name or success != expected[note].success:
                found.append(f"{request} became {recorded[note][0]}")
            since, until = request.at - timedelta(seconds=1), request.answered_at + timedelta(seconds=1)
            if not f"{since:%Y-%m-%d %H:%M:%S}" <= str(at) <= f"{until:%Y-%m-%d %H:%M:%S.%f}":
                found.append(f"{request} is of {at}")
    by_button = "SELECT COUNT(*) FROM event WHERE kind = 'intervention' AND text LIKE 'stopped with the page%'"
    if operators.study.rows(by_button)[0][0] < operators.stopped:
        found.append("a STOP that a phone confirmed is not recorded")
    return found
