"""Operators with phones who run a blind study to its end, through kills, reloads and network failures."""

import random
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Literal

from playwright.sync_api import Error

from tests.web.blind_study import ARM_NAMES, PATIENCE_S, BlindStudy, wait_until
from tests.web.phone import GivenJudgement, Phone, Screen, chromium_of_phones, page_has_changed, phone_in
from tests.web.tcp_relay import TcpRelay

Disturbance = Literal["kill", "reload", "offline", "both"]
DISTURBANCES: dict[str, tuple[Disturbance, ...]] = {
    "sign-in": ("kill", "reload", "offline"),
    "placing": ("kill", "reload", "offline", "both"),
    "measured": ("kill", "reload", "offline", "both"),
    "driving": ("kill", "reload", "offline"),
    "judging": ("kill", "reload", "offline", "both"),
    "confirming": ("kill", "reload", "offline"),
    "finish": ("kill", "reload", "offline"),
}
"""Possible disturbances per screen; confirming is the time after a judgement was sent."""
ONCE = ("sign-in", "finish")
"""Screens that appear once, so all their disturbances happen one after another."""


def schedule(trials: int, chance: random.Random) -> list[tuple[str, Disturbance]]:
    """Return the disturbances of a study: each kind at each screen, then random ones.

    A study with fewer than `TRIALS_FOR_ALL` trials gets the first few only.
    """
    every = [
        (screen, kinds[(turn + place) % len(kinds)])
        for turn in range(4)
        for place, (screen, kinds) in enumerate(DISTURBANCES.items())
        if turn < len(kinds)
    ]
    if trials < TRIALS_FOR_ALL:
        return every[: max(3, trials)]
    return [*every, *chance.choices([entry for entry in every if entry[0] not in ONCE], k=max(0, trials - len(every)))]


TRIALS_FOR_ALL = 12


class PhoneOperators:
    """Operators with a phone each, at one run."""

    def __init__(
        self, study: BlindStudy, phones: list[Phone], chance: random.Random, disturbances: list[tuple[str, Disturbance]]
    ) -> None:
        """Prepare the operators.

        Args:
            study: a study with a served page.
            phones: the phones; the first is used most.
            chance: source of random numbers.
            disturbances: screens and disturbances, in any order.
        """
        self.study = study
        self.phones = phones
        self.chance = chance
        self.disturbances = disturbances
        self.log: Callable[[str], object] = lambda _text: None
        """Called for each disturbance."""
        self.spread = True
        """Whether to spread disturbances over the trials, instead of using the first opportunity."""
        self.happened: Counter[str] = Counter()
        self.judgements: list[GivenJudgement] = []
        self.stopped = 0
        """Number of episodes that a STOP button has ended."""
        self._driven: set[int] = set()
        for phone in phones:
            phone.press_timeout_ms = 5_000  # short, because the other operator may be first
        self._disturbed: set[tuple[str, int, int]] = set()

    def run_session(self) -> None:
        """Use the page until the session ends."""
        for phone in self.phones:
            phone.enter()
        changed_s, last = time.monotonic(), None
        while self.study.code is None:
            phone = self.phones[0] if self.chance.random() < 0.8 else self.phones[-1]
            try:
                screen = phone.screen()
                if (phone.name, screen) != last:
                    last, changed_s = (phone.name, screen), time.monotonic()
                self._at(phone, screen)
            except Error as error:
                if not page_has_changed(error) and self.study.code is None:
                    raise
                self.log(f"{phone.name}, {last[1].name if last else 'at first'}: {str(error).splitlines()[:3]}")
            assert time.monotonic() - changed_s < PATIENCE_S, f"no change: {last}; {self.study.log.read_text()[-2000:]}"

    def _at(self, phone: Phone, screen: Screen) -> None:
        assert screen.name != "refused", "the page refuses its address"
        disturbance = self._disturbance(screen) if not (screen.is_cut or screen.has_dialog) else None
        if disturbance is not None and disturbance not in ("both",):
            self._disturb(phone, disturbance, screen)
            return
        acts: dict[str, Callable[[], object]] = {
            "sign-in": phone.sign_in,
            "placing": lambda: self._place(phone, screen, both=disturbance == "both"),
            "measured": lambda: self._go(phone, screen, both=disturbance == "both"),
            "driving": lambda: self._drive(phone),
            "judging": lambda: self._judge(phone, screen, both=disturbance == "both"),
            "finish": lambda: self._finish(phone, screen),
        }
        if screen.has_dialog:
            phone.press("#dialog [value=yes]")
        elif screen.is_cut or screen.name not in acts:
            phone.page.wait_for_timeout(50)
        elif screen.unjudged and not screen.is_busy and screen.name in ("placing", "finish"):
            self._judge_listed(phone, screen.unjudged[-1])
        else:
            acts[screen.name]()

    def _disturbance(self, screen: Screen, moment: str = "") -> Disturbance | None:
        """Return the disturbance for now, at most one per screen and trial."""
        name = moment or screen.name
        here = (name, screen.episode, self.study.kills)
        waiting = [entry for entry in self.disturbances if entry[0] == name]
        if not waiting or (name not in ONCE and (here in self._disturbed or not self._is_time())):
            return None
        self._disturbed.add(here)
        self.disturbances.remove(waiting[0])
        self.happened[" ".join(waiting[0])] += 1
        self.log(f"#{screen.episode}, {len(self.judgements)} judgements: {' '.join(waiting[0])}")
        return waiting[0][1]

    def _is_due(self, name: str) -> bool:
        return any(entry[0] == name for entry in self.disturbances) and self._is_time()

    def _is_time(self) -> bool:
        """Whether the next disturbance is due, when they are spread over all but the last trials."""
        if not self.spread:
            return True
        judged = self.study.rows("SELECT COUNT(*) FROM episode WHERE state = 'judged'")[0][0]
        happened = self.happened.total()
        return happened <= (happened + len(self.disturbances)) * (judged + 0.5) / max(1, 0.8 * self.study.trials)

    def _disturb(self, phone: Phone, disturbance: Disturbance, screen: Screen) -> None:
        given = None
        if screen.name == "judging":  # a draft must survive the disturbance
            given = self._judgement()
            phone.fill_judgement("#judging", given)
        typed = phone.typed("#judging") if given else {}
        if disturbance == "kill":
            self._kill()
        elif disturbance == "reload":
            phone.page.reload()
            phone.page.wait_for_selector("#link.up")
        else:
            with self._without_network(phone):
                self._press_without_network(phone, screen, given)
        now = phone.screen()
        if given and now.name == "judging" and now.episode == screen.episode:
            restored = phone.typed("#judging")
            assert restored == typed, (disturbance, restored, typed)

    @contextmanager
    def _without_network(self, phone: Phone) -> Iterator[None]:
        try:
            phone.leave_network()
            yield
        finally:
            phone.return_to_network(cut=self.chance.random() < 0.5)

    def _press_without_network(self, phone: Phone, screen: Screen, given: GivenJudgement | None) -> None:
        """Press a button without a network; the page must show the failure."""
        if screen.name in ("placing", "measured") and not screen.is_busy:
            phone.press("#go")
        elif screen.name == "judging" and given:
            phone.confirm("#judging", given)
        elif screen.name == "driving":
            phone.page.locator("#stop").dispatch_event("pointerdown")
            phone.page.wait_for_selector("#stop-text:has-text('NOT CONNECTED')")
        else:
            return
        if screen.name != "driving":
            phone.page.wait_for_selector(".notice:has-text('does not answer')")

    def _kill(self) -> None:
        self.phones[0].page.wait_for_timeout(self.chance.uniform(0, 300))
        self.study.kill()
        self.study.start()
        self.study.wait_served()

    def _place(self, phone: Phone, screen: Screen, *, both: bool) -> None:
        if screen.is_busy:
            phone.page.wait_for_timeout(50)
        elif self.chance.random() < 0.1 or self._is_due("measured"):
            phone.press("#check")
            phone.page.wait_for_selector("#moved:visible, #go:not([disabled]):visible")
        elif self.chance.random() < 0.03:
            phone.press("#skip")
        elif self.chance.random() < 0.03:
            phone.press("#pause")
            phone.page.wait_for_selector("#go[disabled]")
            phone.press("#pause")
            phone.page.wait_for_selector("#go:not([disabled])")
        else:
            self._go(phone, screen, both=both)

    def _go(self, phone: Phone, screen: Screen, *, both: bool) -> None:
        if both:
            self._at_once(dict.fromkeys(self.phones, "#go"))
        else:
            phone.press("#go")
        self._until_other(phone, screen)

    def _drive(self, phone: Phone) -> None:
        episode = phone.screen().episode
        if episode not in self._driven and self.chance.random() < 0.04:
            phone.page.locator("#stop").dispatch_event("pointerdown")
            phone.page.wait_for_function("() => !/^$|stopping/.test(document.getElementById('stop-text').textContent)")
            self.stopped += phone.screen().stop_text == "Stopped. The episode ends here."
        else:
            phone.page.wait_for_timeout(100)
        self._driven.add(episode)

    def _judgement(self) -> GivenJudgement:
        """Return a random judgement with a unique note."""
        note = f"judgement {len(self.judgements) + 1}"
        given = self.chance.choices(
            [
                GivenJudgement(note, distance="0.84"),
                GivenJudgement(note, distance="123 cm"),
                GivenJudgement(note, touched="leg of the table"),
                GivenJudgement(note, void=note),
            ],
            [5, 2, 3, 0.5],
        )[0]
        self.judgements.append(given)
        return given

    def _judge(self, phone: Phone, screen: Screen, *, both: bool) -> None:
        if both:
            for each in self.phones:
                each.page.wait_for_selector("#judging .judging-form")
            given_by = {each: self._judgement() for each in self.phones}
            buttons = {}
            for each, given in given_by.items():
                each.fill_judgement("#judging", given)
                buttons[each] = f"#judging .judging-form {'[data-void]' if given.void else 'button.go'}"
            self._at_once(buttons)
        elif not self._is_due("confirming") and self.chance.random() < 0.05:
            phone.press("#judging [data-later]")
        else:
            given = self._judgement()
            if self.chance.random() < 0.1 and not (given.touched or given.void):
                self._mistype(phone, given)
            phone.fill_judgement("#judging", given)
            phone.confirm("#judging", given)
            if (disturbance := self._disturbance(screen, "confirming")) is not None:
                phone.page.wait_for_timeout(self.chance.uniform(0, 30))
                if disturbance == "offline":
                    with self._without_network(phone):
                        pass
                elif disturbance == "kill":
                    self._kill()
                else:
                    phone.page.reload()
                return
        self._until_other(phone, screen)

    def _mistype(self, phone: Phone, given: GivenJudgement) -> None:
        for typed in ("84", "-1", "about a metre"):
            phone.fill_judgement("#judging", GivenJudgement(given.note, distance=typed))
            phone.confirm("#judging", given)
            phone.page.wait_for_selector(f".notice:has-text('{typed}')")

    def _judge_listed(self, phone: Phone, episode: int) -> None:
        """Judge an episode in the list, and sometimes undo the judgement."""
        given, within = self._judgement(), f".episode[data-episode='{episode}']"
        if not phone.page.locator(f"{within} [data-amend]").is_visible():
            phone.press("#episodes-card summary")
        if not phone.page.locator(f"{within} .judging-form").is_visible():
            phone.press(f"{within} [data-amend]")
        phone.fill_judgement(within, given)
        phone.confirm(within, given)
        self._confirm_dialog(phone, f"{within} .judging-form")
        if self.chance.random() < 0.3 and phone.page.locator(f"{within} [data-undo]").is_visible():
            phone.press(f"{within} [data-undo]")
            phone.page.wait_for_selector(f"{within} [data-amend]:has-text('Judge')")

    def _confirm_dialog(self, phone: Phone, selector: str) -> None:
        """Confirm a dialog if there is one, until the form closes or shows an error."""
        phone.page.wait_for_selector(f"#dialog[open], body:not(:has({selector})), {selector} .notice:not([hidden])")
        if phone.screen().has_dialog:
            phone.press("#dialog [value=yes]")
            phone.page.wait_for_selector(f"body:not(:has({selector})), {selector} .notice:not([hidden])")

    def _until_other(self, phone: Phone, screen: Screen) -> None:
        """Wait until the page shows a reaction."""
        wait_until(lambda: phone.screen() != screen or phone.page.wait_for_timeout(30), f"an answer at {screen}")

    def _at_once(self, selectors: dict[Phone, str]) -> None:
        """Press a button on each phone at the same time."""
        time_ms = time.time() * 1000 + 250
        for phone, selector in selectors.items():
            phone.click_at(selector, time_ms)
        self.phones[0].page.wait_for_timeout(400)

    def _finish(self, phone: Phone, screen: Screen) -> None:
        phone.press("#finish-end")
        phone.page.wait_for_selector("#dialog[open]")
        if "a judgement" in phone.page.inner_text("#dialog-text"):  # before the list showed it
            phone.press("#dialog [value=no]")
            wait_until(lambda: phone.screen().unjudged or phone.page.wait_for_timeout(30), "the list shows it")
            return
        phone.press("#dialog [value=yes]")
        wait_until(lambda: self.study.code is not None or phone.page.wait_for_timeout(50), "the session ends")


@contextmanager
def phone_operators(
    study: BlindStudy,
    chance: random.Random,
    disturbances: list[tuple[str, Disturbance]],
    names: Sequence[str] = ("Anna", "Ben"),
) -> Iterator[PhoneOperators]:
    """Start the run of a study with up to two operators."""
    with ExitStack() as stack:
        operators = list(zip(names, ("127.0.0.1", "localhost"), strict=False))
        relays = [stack.enter_context(TcpRelay(study.port, search_for=ARM_NAMES)) for _ in operators]
        routes = [(host, relay, study.port) for (_, host), relay in zip(operators, relays, strict=True)]
        study.start()
        address = study.wait_served()
        browser = stack.enter_context(chromium_of_phones(*routes))
        phones = [
            phone_in(browser, *operator, relay, address) for operator, relay in zip(operators, relays, strict=True)
        ]
        yield PhoneOperators(study, phones, chance, disturbances)
