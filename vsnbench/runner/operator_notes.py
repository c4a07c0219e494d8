"""What the person beside the robot adds to the record: judgements and interventions, under the person's name."""

from vsnbench.database.interventions import INTERVENTION, intervention_words
from vsnbench.database.journal import Journal
from vsnbench.protocol.judge import Verdict


class OperatorNotes:
    """Writes to the journal in the name of one person; each note is committed before the call returns."""

    def __init__(self, journal: Journal, name: str) -> None:
        self._journal = journal
        self._name = name

    def verdict(self, episode_id: int, verdict: Verdict) -> None:
        """Let this judgement of an ended episode stand.

        Raises:
            RecordError: it cannot be written.
        """
        self._journal.judge(episode_id, verdict, author=self._name)

    def intervention(self, episode_id: int, step_number: int, what: str) -> None:
        """Note what was done to the robot in or after an episode; `step_number` is its last action, 0 for none.

        Raises:
            RecordError: it cannot be written.
        """
        words = intervention_words(what, self._name)
        self._journal.add_event(INTERVENTION, words, episode_id=episode_id, step_number=step_number or None)
