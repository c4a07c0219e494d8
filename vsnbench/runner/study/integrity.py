"""Compares a study in the record with its lock, its log and the random draw, and names each difference."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vsnbench.errors import VsnbenchError
from vsnbench.protocol.scheduled_trial import ScheduledTrial
from vsnbench.results.reading.episode_numbers import as_ranges
from vsnbench.results.studies.entries import AMEND, LOCK, UNBLIND, RecordedStudy
from vsnbench.results.studies.evidence import EndedEpisode, StudyEvidence
from vsnbench.results.studies.log import ENTRY, OUTCOME, LogEvent, heads_of
from vsnbench.runner.setup.selection import choose_starts
from vsnbench.sites.site import Site
from vsnbench.study.file import StudyFile
from vsnbench.study.lock import LockNote, sha256_of
from vsnbench.study.schedule import Schedule, schedules_of
from vsnbench.text.sanitize import counted, sanitize


@dataclass(frozen=True, slots=True)
class StudyIntegrity:
    """What a comparison of a study with its lock and its log found."""

    differences: tuple[str, ...]
    """Changes made outside of vsnbench; they block further trials."""
    remarks: tuple[str, ...]
    """Facts that could not be verified, and missing episodes that may belong to another study."""


def check_integrity(
    recorded: RecordedStudy, evidence: StudyEvidence, plan: StudyFile, note: LockNote | None
) -> StudyIntegrity:
    """Compare a study with its lock, its log and the random draw.

    `plan` is the plan in the record, and `note` the file that `study lock` wrote, None where there is none.
    """
    check = _Check(recorded, evidence, plan, note)
    differences = (
        *check.plan_differences(),
        *check.schedule_differences(),
        *check.log_differences(),
        *evidence.identity_faults,
    )
    return StudyIntegrity(tuple(dict.fromkeys(differences)), tuple(check.remarks()))


_OUTCOME_FIELDS = {
    "episode": str,
    "arm": str,
    "goal": str,
    "start": int,
    "repetition": int,
    "state": str,
    "verdicts": int,
    "verdict": dict | None,
    "measured": dict,
}
"""Types of the fields of an outcome; `measured` is absent in version 1."""


class _Check:
    """One comparison."""

    def __init__(
        self, recorded: RecordedStudy, evidence: StudyEvidence, plan: StudyFile, note: LockNote | None
    ) -> None:
        self.recorded, self.evidence, self.plan, self.note = recorded, evidence, plan, note
        self.locks: list[Mapping[str, Any]] = []
        self.plans: list[str] = []
        self.outcomes: dict[str, list[Mapping[str, Any]]] = {}
        self.logged_entries: list[Mapping[str, Any]] = []
        for event in evidence.log:
            content = _content(event)
            if event.kind == OUTCOME and _is_outcome(content):
                self.outcomes.setdefault(content["episode"], []).append(content)
            elif event.kind == ENTRY and isinstance(entry := content.get("entry"), dict):
                self.logged_entries.append(entry)
                if entry.get("kind") == LOCK:
                    self.locks.append(content)
                if entry.get("kind") in (LOCK, AMEND):
                    self.plans.append(str(content.get("plan")))
        locked = sum(entry.kind == LOCK for entry in recorded.entries)
        self.logged_from_start = bool(self.locks) and locked <= len(self.locks)
        """False for a study that an older version locked, in this record or in one merged into it."""
        roots = sum(not event.parents for event in evidence.log)
        self.forked = roots > 1 or any(len(event.parents) > 1 for event in evidence.log) or len(evidence.heads) > 1
        self.possible = _possible_schedules(plan, evidence.site_content)
        """Every order in which the trials can have been drawn, the one that is drawn now first."""

    def plan_differences(self) -> Iterator[str]:
        recorded, plan = self.recorded, self.plan
        if sha256_of(recorded.content) != recorded.sha256:
            yield "the plan in the record does not have the hash that was locked"
        expected = self.plans if self.forked else self.plans[-1:]
        if self.logged_from_start and recorded.sha256 not in expected:
            yield f"the plan in the record was {expected[-1][:12]} by the log and is {recorded.sha256[:12]}"
        facts = (("title", plan.title, recorded.title), ("blind", plan.blind, recorded.blind))
        for name, was, now in (*facts, ("seed", plan.seed, self.evidence.seed)):
            if was != now:
                yield f"{name} was {was} in the plan and is {now} in the record"
        unblinded = any(entry.kind == UNBLIND for entry in recorded.entries)
        if unblinded != (recorded.unblinded_at is not None):
            yield "the study was unblinded, and is blind again" if unblinded else "it was unblinded without an entry"

    def schedule_differences(self) -> Iterator[str]:
        recorded, rows = self.recorded, self.evidence.schedule
        codes = {arm.name: arm.code for arm in recorded.arms}
        now = Schedule(rows, codes)
        noted = self.note.schedule_sha256 if self.note is not None else ""
        logged = {str(lock.get("schedule")) for lock in self.locks}
        locked = logged | ({noted} if noted else set())
        if noted and logged and noted not in logged:
            yield f"the schedule's hash is {noted[:12]} in the lock file and was {min(logged)[:12]} by the log"
        if locked and recorded.schedule_sha256 not in locked:
            yield f"the schedule's hash was {min(locked)[:12]} and is {recorded.schedule_sha256[:12]}"
        yield from self._arm_differences()
        wanted = locked or {recorded.schedule_sha256}
        differs = now.fingerprint not in wanted
        if not self.possible:
            if differs:
                yield "the schedule or the codes are not those that were locked"
            return
        drawn = next((schedule for schedule in self.possible if schedule.fingerprint in wanted), self.possible[0])
        if differs or drawn.fingerprint not in wanted:
            yield from self._against_the_draw(drawn, rows, codes)
            if not differs:
                yield f"the order of the trials is not the random draw from seed {self.plan.seed}"

    def _locked_arms(self) -> list[list[str]]:
        """Return name, code and campaign of each arm by the log, as far as it is well-formed."""
        arms: Any = self.locks[0].get("arms") if self.locks else []
        if not isinstance(arms, list):
            return []
        return [arm for arm in arms if isinstance(arm, list) and list(map(type, arm)) == [str, str, str]]

    def _arm_differences(self) -> Iterator[str]:
        now = {arm.name: (arm.code, arm.campaign_key) for arm in self.recorded.arms}
        for name, code, key in self._locked_arms():
            if name not in now:
                yield f"the arm of code {code} is gone or was renamed"
            elif now[name][0] != code:
                yield f"the code of an arm was {code} and is {now[name][0]}"
            elif now[name][1] != key:
                yield f"arm {code} was another campaign (model, robot, site, protocol) when it was locked"

    def _against_the_draw(
        self, drawn: Schedule, rows: Sequence[ScheduledTrial], codes: Mapping[str, str]
    ) -> Iterator[str]:
        if not self.locks:
            for name, code in drawn.codes.items():
                if codes.get(name) != code:
                    yield f"the code of an arm was {code} and is {codes.get(name, 'gone')}"
        found = {row.rank: row for row in rows}
        for was in drawn.trials:
            now = found.pop(was.rank, None)
            if now is None:
                yield f"trial {was.rank + 1} was {self._trial(was)} and is gone"
            elif (was.block, was.arm, was.goal, was.start, was.repetition) != (
                *(now.block, now.arm, now.goal, now.start, now.repetition),
            ):
                yield f"trial {was.rank + 1} was {self._trial(was)} and is {self._trial(now)}"
        for row in found.values():
            yield f"trial {row.rank + 1} is {self._trial(row)} and was not planned"

    def _trial(self, trial: ScheduledTrial | EndedEpisode) -> str:
        repetition = f", repetition {trial.repetition}" if trial.repetition > 1 else ""
        return f"{self._arm(trial.arm)} on {trial.goal} from {trial.start}{repetition}"

    def _arm(self, name: str) -> str:
        """Return what people may call an arm: by the code that was locked."""
        if not self.recorded.is_blind:
            return name
        locked = {arm: code for arm, code, _ in self._locked_arms()}
        codes = locked or (self.possible[0].codes if self.possible else {})
        return f"arm {codes[name]}" if name in codes else "an arm"

    def log_differences(self) -> Iterator[str]:
        events, heads = self.evidence.log, self.evidence.heads
        hashes = {event.sha256 for event in events}
        for event in events:
            if not event.is_intact:
                yield f"the log's event of {event.created_at:%Y-%m-%d %H:%M:%S} UTC was edited"
            if event.parents - hashes:
                yield f"an event of the log before {event.created_at:%Y-%m-%d %H:%M:%S} UTC was deleted or edited"
        if heads - hashes:
            yield "the newest event of the log was deleted or edited"
        elif heads_of(events) != heads and all(event.parents <= hashes for event in events):
            yield "the log has an event that vsnbench did not append"
        if self.note is not None and self.note.event_sha256 and self.note.event_sha256 not in hashes:
            yield "the log does not begin with the event that `study lock` wrote"
        yield from self._entry_differences()
        for identity, logged in self.outcomes.items():
            yield from self._episode_differences(logged, self.evidence.episodes.get(identity))
        if self.logged_from_start:
            for identity, episode in self.evidence.episodes.items():
                if identity not in self.outcomes:
                    yield f"episode #{episode.number} ({self._trial(episode)}) is not in the log"

    def _entry_differences(self) -> Iterator[str]:
        logged = Counter(json.dumps(entry, sort_keys=True) for entry in self.logged_entries)
        recorded = Counter(json.dumps(dict(entry), sort_keys=True) for entry in self.evidence.entries)
        for entry in (logged - recorded).elements():
            yield f"the history lacks what the log has: {_entry(json.loads(entry))}"
        if self.logged_from_start:
            for entry in (recorded - logged).elements():
                yield f"the history has what the log lacks: {_entry(json.loads(entry))}"

    def _episode_differences(self, logged: Sequence[Mapping[str, Any]], now: EndedEpisode | None) -> Iterator[str]:
        most = max(outcome["verdicts"] for outcome in logged)
        latest = [outcome for outcome in logged if outcome["verdicts"] == most]
        where = ScheduledTrial(0, 0, *(latest[-1][name] for name in ("arm", "goal", "start", "repetition")))
        result = _verdict(latest[-1]["verdict"], latest[-1]["state"])
        if now is None:
            yield f"an episode was deleted: {self._trial(where)}, which was {result}"
            return
        name = f"episode #{now.number}"
        if (now.arm, now.goal, now.start, now.repetition) != (where.arm, where.goal, where.start, where.repetition):
            yield f"{name} was {self._trial(where)} and is {self._trial(now)}"
        if now.state not in {outcome["state"] for outcome in (latest if self.forked else latest[-1:])}:
            yield f"{name} ({self._trial(where)}) was {latest[-1]['state']} and is {now.state}"
        if len(now.verdicts) != most:
            yield f"{name} ({self._trial(where)}) had {most} verdicts and has {len(now.verdicts)}"
        yield from self._measured_differences(f"{name} ({self._trial(where)})", logged, now.measured)
        for outcome in logged:
            place, was = outcome["verdicts"], outcome["verdict"]
            if was is not None and 0 < place <= len(now.verdicts) and dict(now.verdicts[place - 1]) != was:
                changed = now.verdicts[place - 1]
                fields = ", ".join(name for name, value in was.items() if changed.get(name) != value)
                yield (
                    f"verdict {place} of {name} ({self._trial(where)}) was {_verdict(was)} and is {_verdict(changed)} "
                    f"(changed: {fields})"
                )

    @staticmethod
    def _measured_differences(name: str, logged: Sequence[Mapping[str, Any]], now: Mapping[str, Any]) -> Iterator[str]:
        """Compare what was measured; it does not change after the end of an episode."""
        for outcome in logged:
            was = outcome.get("measured", {})
            changed = [
                f"{field} was {_value(value)} and is {_value(now.get(field))}"
                for field, value in was.items()
                if now.get(field) != value
            ]
            if changed:
                yield f"{name}: {', '.join(changed)}"

    def remarks(self) -> Iterator[str]:
        if not self.logged_from_start:
            first = f" before {self.evidence.log[0].created_at:%Y-%m-%d %H:%M} UTC" if self.evidence.log else ""
            yield f"locked by an older version: no event chain{first}, so a changed verdict cannot be noticed"
        without = sum(not any("measured" in outcome for outcome in logged) for logged in self.outcomes.values())
        if without:
            yield (
                f"{counted(without, 'episode')} logged by an older version without lengths and progress, so a change "
                "of these cannot be noticed"
            )
        if self.evidence.missing_numbers:
            missing = self.evidence.missing_numbers
            which = "episode {} of this record is" if len(missing) == 1 else "episodes {} of this record are"
            yield f"{which.format(as_ranges(missing))} missing: deleted with `vsnbench db delete` or another program"


def _content(event: LogEvent) -> Mapping[str, Any]:
    """Return the content of an event; empty if it was edited, which is reported as such."""
    if not event.is_intact:
        return {}
    try:
        content = json.loads(event.content)
    except (ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _is_outcome(content: Mapping[str, Any]) -> bool:
    """Return whether the content of an event is that of an episode's outcome; the log is of unknown origin."""
    needed = {name: kind for name, kind in _OUTCOME_FIELDS.items() if name in content or name != "measured"}
    return content.keys() >= needed.keys() and all(isinstance(content[name], kind) for name, kind in needed.items())


def _value(value: object) -> str:
    return sanitize(f"{value:.6g}" if isinstance(value, float) else "nothing" if value is None else str(value))


def _entry(entry: Mapping[str, Any]) -> str:
    moment = str(entry.get("created_at"))[:19].replace("T", " ")
    return sanitize(f"{entry.get('kind')} of {moment} UTC by {entry.get('author')}")


def _verdict(verdict: Mapping[str, Any] | None, state: str = "") -> str:
    if verdict is None:
        return sanitize(state)
    success = verdict.get("success")
    return "void" if not isinstance(success, bool) else "a success" if success else "a failure"


def _possible_schedules(plan: StudyFile, site_content: Mapping[str, Any]) -> tuple[Schedule, ...]:
    """Draw the schedule of a plan again, in every order that a lock can hold.

    A sequential study of these cells rests on the random order of its blocks, so no other order is possible there.
    Returns nothing where the site in the record cannot be used.
    """
    try:
        site = Site.model_validate(site_content)
        possible = schedules_of(plan, choose_starts(plan.starting_positions, site), site.excluded)
    except (VsnbenchError, ValueError):
        return ()
    return possible[:1] if plan.of_these_cells else possible
