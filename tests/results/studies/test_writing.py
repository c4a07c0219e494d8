from dataclasses import replace
from datetime import UTC, datetime

import pytest

from tests.results.records_of_a_lab import plan
from tests.results.studies_of_a_lab import lock
from vsnbench.errors import StudyError
from vsnbench.results.reading.queries import list_campaigns
from vsnbench.results.reading.read_model import HIDDEN
from vsnbench.results.studies.entries import SESSION, SESSION_END, RecordedArm, RecordedStudy
from vsnbench.results.studies.queries import studies, study_of_campaign
from vsnbench.results.writing.journal import Journal
from vsnbench.results.writing.provenance import gather_provenance


def test_a_locked_study_is_read_back_and_its_models_have_codes_until_it_is_unblinded(url: str) -> None:
    with Journal.open(url) as journal:
        study = lock(journal)
        assert studies(journal.engine) == (study,)
        assert [(arm.name, arm.code, study.shown(arm.name)) for arm in study.arms] == [
            ("owl", "A", "arm A"),
            ("lark", "B", "arm B"),
        ]
        blind = list_campaigns(journal.engine)
        assert [one.model for one in blind] == ["study1-A", "study1-B"]
        assert {one.name for one in blind} | {one.key for one in blind} == {"study1-A", "study1-B"}
        journal.unblind_study(study.id, "done")
        assert [one.model for one in list_campaigns(journal.engine)] == ["another", plan().model.name]
        with pytest.raises(StudyError, match="not blind"):
            journal.unblind_study(study.id, "again")
        assert HIDDEN not in str(list_campaigns(journal.engine))


def test_a_second_study_on_the_same_trials_is_refused_and_leaves_nothing(url: str) -> None:
    with Journal.open(url) as journal:
        study = lock(journal)
        with pytest.raises(StudyError, match="seed 3 is that of the blinded study 'Which\\?'"):
            lock(journal)
        journal.unblind_study(study.id, "done")
        with pytest.raises(StudyError, match="already belongs to the study 'Which\\?'"):
            lock(journal)
        assert len(list_campaigns(journal.engine)) == 2
        assert study_of_campaign(journal.engine, study.arms[0].campaign_key) == "Which?"
        lock(journal, seed=4)


def test_trials_that_were_begun_before_the_plan_are_refused(sqlite: str) -> None:
    with Journal.open(sqlite) as journal:
        campaign = journal.find_or_create_campaign(replace(plan(), seed=3))
        assert journal.claim_next(campaign.id, [campaign.trials[0].id])
        with pytest.raises(StudyError, match="has 1 episodes of these trials from before the lock"):
            lock(journal)
        assert len(list_campaigns(journal.engine)) == 1


def test_who_else_runs_a_study_is_named_while_that_process_lives(url: str) -> None:
    eva = replace(gather_provenance(), operator="Eva")
    with Journal.open(url) as mine, Journal.open(url, eva) as hers:
        study = lock(mine)
        assert mine.other_running_process(study.id) == ""
        hers.note_in_study(study.id, SESSION)
        assert mine.other_running_process(study.id).startswith("Eva (process ")
        assert hers.other_running_process(study.id) == ""
        hers.note_in_study(study.id, SESSION_END)
        assert mine.other_running_process(study.id) == ""


def test_a_name_of_one_letter_is_not_in_every_word_that_a_blind_study_says() -> None:
    arms = [
        RecordedArm(name, code, 1, "", "", model, "", "", surveyed=False)
        for name, code, model in (("a", "B", "oracle"), ("il", "A", "pirlnav"))
    ]
    when = datetime(2026, 1, 1, tzinfo=UTC)
    study = RecordedStudy(1, "", "T", "", "", "", "", True, when, None, tuple(arms), ())
    for telling in ("line 3 is `A: x`", "weights: il.ckpt", "model: PIRLNav-2", "arms/oracles.py"):
        assert study.reveals_arm(telling), telling
    for sanitize in ("line 25 is `starting_positions: 1-3`, and was `starting_positions: 1-2`", "until 8"):
        assert not study.reveals_arm(sanitize), sanitize
    assert not replace(study, unblinded_at=when).reveals_arm("oracle")
