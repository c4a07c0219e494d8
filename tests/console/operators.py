"""People with phones who run a blind study to its end by clicks, whatever happens to run, network and pages."""

import random
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Literal

from playwright.sync_api import Error

from tests.console.phone import Phone, Said, Screen, chromium_of_phones, gone, phone_in
from tests.console.rehearsal import PATIENCE_S, TELLING, Rehearsal, wait_until
from tests.console.tcp_relay import TcpRelay

Mishap = Literal["kill", "reload", "offline", "both"]
MISHAPS: dict[str, tuple[Mishap, ...]] = {
    "sign-in": ("kill", "reload", "offline"),
    "placing": ("kill", "reload", "offline", "both"),
    "looked": ("kill", "reload", "offline", "both"),
    "driving": ("kill", "reload", "offline"),
    "judging": ("kill", "reload", "offline", "both"),
    "confirming": ("kill", "reload", "offline"),
    "finish": ("kill", "reload", "offline"),
}
"""What can happen at which screen; confirming is the moment after the last button was pressed."""
ONCE = ("sign-in", "finish")
"""Screens that come once: all that is to happen there happens one after another."""


def schedule(trials: int, chance: random.Random) -> list[tuple[str, Mishap]]:
    """Return what is to happen in so many trials: every mishap at every screen, in a fixed order, then some at random.

    Fewer than `TRIALS_FOR_ALL` trials have room for the first few of them alone.
    """
    every = [
        (screen, kinds[(turn + place) % len(kinds)])
        for turn in range(4)
        for place, (screen, kinds) in enumerate(MISHAPS.items())
        if turn < len(kinds)
    ]
    if trials < TRIALS_FOR_ALL:
        return every[: max(3, trials)]
    return [*every, *chance.choices([one for one in every if one[0] not in ONCE], k=max(0, trials - len(every)))]


TRIALS_FOR_ALL = 12


class Operators:
    """Two people with a phone each, at one run."""

    def __init__(
        self, rehearsal: Rehearsal, phones: list[Phone], chance: random.Random, mishaps: list[tuple[str, Mishap]]
    ) -> None:
        """Take the phones in hand.

        Args:
            rehearsal: the study, its run served.
            phones: theirs; the first is used more.
            chance: what they say, and when what happens.
            mishaps: what is to happen at which screen, in any order.
        """
        self.run = rehearsal
        self.phones = phones
        self.chance = chance
        self.mishaps = mishaps
        self.tell: Callable[[str], object] = lambda _words: None
        """Told of each mishap."""
        self.spread = True
        """What happens is spread over the trials; else each comes at its first occasion."""
        self.happened: Counter[str] = Counter()
        self.said: list[Said] = []
        self.stopped = 0
        """Episodes that a phone said were ended by its STOP."""
        self._driven: set[int] = set()
        for phone in phones:
            phone.thumb_ms = 5_000  # what is there to press may go: the other phone was first, so look again
        self._met: set[tuple[str, int, int]] = set()

    def attend(self) -> None:
        """Click until the session is over."""
        for phone in self.phones:
            phone.enter()
        moved, last = time.monotonic(), None
        while self.run.code is None:
            phone = self.phones[0] if self.chance.random() < 0.8 else self.phones[-1]
            try:
                screen = phone.screen()
                if (phone.name, screen) != last:
                    last, moved = (phone.name, screen), time.monotonic()
                self._at(phone, screen)
            except Error as error:
                if not gone(error) and self.run.code is None:
                    raise
                self.tell(f"{phone.name}, {last[1].name if last else 'at first'}: {str(error).splitlines()[:3]}")
            assert time.monotonic() - moved < PATIENCE_S, f"nothing moves: {last}; {self.run.log.read_text()[-2000:]}"

    def _at(self, phone: Phone, screen: Screen) -> None:
        assert screen.name != "refused", "the page asks for its address again"
        mishap = self._mishap(screen) if not (screen.cut or screen.asked) else None
        if mishap is not None and mishap not in ("both",):
            self._happens(phone, mishap, screen)
            return
        acts: dict[str, Callable[[], object]] = {
            "sign-in": phone.sign_in,
            "placing": lambda: self._place(phone, screen, both=mishap == "both"),
            "looked": lambda: self._go(phone, screen, both=mishap == "both"),
            "driving": lambda: self._drive(phone),
            "judging": lambda: self._judge(phone, screen, both=mishap == "both"),
            "finish": lambda: self._finish(phone, screen),
        }
        if screen.asked:
            phone.press("#ask [value=yes]")
        elif screen.cut or screen.name not in acts:
            phone.page.wait_for_timeout(50)
        elif screen.unjudged and not screen.busy and screen.name in ("placing", "finish"):
            self._judge_listed(phone, screen.unjudged[-1])
        else:
            acts[screen.name]()

    def _mishap(self, screen: Screen, moment: str = "") -> Mishap | None:
        """Return what happens now, at most once at the same screen of the same trial."""
        name = moment or screen.name
        here = (name, screen.episode, self.run.kills)
        waiting = [one for one in self.mishaps if one[0] == name]
        if not waiting or (name not in ONCE and (here in self._met or not self._is_time())):
            return None
        self._met.add(here)
        self.mishaps.remove(waiting[0])
        self.happened[" ".join(waiting[0])] += 1
        self.tell(f"#{screen.episode}, {len(self.said)} judgements: {' '.join(waiting[0])}")
        return waiting[0][1]

    def _is_due(self, name: str) -> bool:
        return any(one[0] == name for one in self.mishaps) and self._is_time()

    def _is_time(self) -> bool:
        """Whether as much has happened as is due: mishaps are spread over all trials but the last few."""
        if not self.spread:
            return True
        judged = self.run.rows("SELECT COUNT(*) FROM episode WHERE state = 'judged'")[0][0]
        happened = self.happened.total()
        return happened <= (happened + len(self.mishaps)) * (judged + 0.5) / max(1, 0.8 * self.run.trials)

    def _happens(self, phone: Phone, mishap: Mishap, screen: Screen) -> None:
        said = None
        if screen.name == "judging":  # what is half typed outlives it
            said = self._word()
            phone.fill_judgement("#judging", said)
        typed = phone.typed("#judging") if said else {}
        if mishap == "kill":
            self._kill()
        elif mishap == "reload":
            phone.page.reload()
            phone.page.wait_for_selector("#link.up")
        else:
            with self._without_network(phone):
                self._press_into_the_void(phone, screen, said)
        now = phone.screen()
        if said and now.name == "judging" and now.episode == screen.episode:
            kept = phone.typed("#judging")
            assert kept == typed, (mishap, kept, typed)

    @contextmanager
    def _without_network(self, phone: Phone) -> Iterator[None]:
        try:
            phone.leave_network()
            yield
        finally:
            phone.return_to_network(cut=self.chance.random() < 0.5)

    def _press_into_the_void(self, phone: Phone, screen: Screen, said: Said | None) -> None:
        """Press what can be pressed without a network; the page must say that nobody heard."""
        if screen.name in ("placing", "looked") and not screen.busy:
            phone.press("#go")
        elif screen.name == "judging" and said:
            phone.confirm("#judging", said)
        elif screen.name == "driving":
            phone.page.locator("#stop").dispatch_event("pointerdown")
            phone.page.wait_for_selector("#stop-words:has-text('NO LINK')")
        else:
            return
        if screen.name != "driving":
            phone.page.wait_for_selector(".words:has-text('no answer from the run')")

    def _kill(self) -> None:
        self.phones[0].page.wait_for_timeout(self.chance.uniform(0, 300))
        self.run.kill()
        self.run.start()
        self.run.wait_served()

    def _place(self, phone: Phone, screen: Screen, *, both: bool) -> None:
        if screen.busy:
            phone.page.wait_for_timeout(50)
        elif self.chance.random() < 0.1 or self._is_due("looked"):
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
            phone.page.wait_for_function("() => !/^$|stopping/.test(document.getElementById('stop-words').textContent)")
            self.stopped += phone.screen().said == "stopped: the episode ends here"
        else:
            phone.page.wait_for_timeout(100)
        self._driven.add(episode)

    def _word(self) -> Said:
        """Return what somebody says, told from all else by its note."""
        note = f"word {len(self.said) + 1}"
        said = self.chance.choices(
            [
                Said(note, distance="0.84"),
                Said(note, distance="123 cm"),
                Said(note, touched="leg of the table"),
                Said(note, void=note),
            ],
            [5, 2, 3, 0.5],
        )[0]
        self.said.append(said)
        return said

    def _judge(self, phone: Phone, screen: Screen, *, both: bool) -> None:
        if both:
            for one in self.phones:
                one.page.wait_for_selector("#judging .judging-form")
            words = {one: self._word() for one in self.phones}
            for one, said in words.items():
                one.fill_judgement("#judging", said)
            button = "#judging .judging-form "
            self._at_once({one: button + ("[data-void]" if w.void else "button.go") for one, w in words.items()})
        elif not self._is_due("confirming") and self.chance.random() < 0.05:
            phone.press("#judging [data-later]")
        else:
            said = self._word()
            if self.chance.random() < 0.1 and not (said.touched or said.void):
                self._mistype(phone, said)
            phone.fill_judgement("#judging", said)
            phone.confirm("#judging", said)
            if (mishap := self._mishap(screen, "confirming")) is not None:
                phone.page.wait_for_timeout(self.chance.uniform(0, 30))
                if mishap == "offline":
                    with self._without_network(phone):
                        pass
                elif mishap == "kill":
                    self._kill()
                else:
                    phone.page.reload()
                return
        self._until_other(phone, screen)

    def _mistype(self, phone: Phone, said: Said) -> None:
        for typed in ("84", "-1", "about a metre"):
            phone.fill_judgement("#judging", Said(said.note, distance=typed))
            phone.confirm("#judging", said)
            phone.page.wait_for_selector(f".words:has-text('{typed}')")

    def _judge_listed(self, phone: Phone, episode: int) -> None:
        """Judge what awaits it in the list below; sometimes undo it at once, or correct it."""
        said, within = self._word(), f".episode[data-episode='{episode}']"
        if not phone.page.locator(f"{within} [data-amend]").is_visible():
            phone.press("#episodes-card summary")
        if not phone.page.locator(f"{within} .judging-form").is_visible():
            phone.press(f"{within} [data-amend]")
        phone.fill_judgement(within, said)
        phone.confirm(within, said)
        self._sure_or_gone(phone, f"{within} .judging-form")
        if self.chance.random() < 0.3 and phone.page.locator(f"{within} [data-undo]").is_visible():
            phone.press(f"{within} [data-undo]")
            phone.page.wait_for_selector(f"{within} [data-amend]:has-text('Judge')")

    def _sure_or_gone(self, phone: Phone, selector: str) -> None:
        """Say yes where it is asked whether somebody is sure, until a form is gone or says why not."""
        phone.page.wait_for_selector(f"#ask[open], body:not(:has({selector})), {selector} .words:not([hidden])")
        if phone.screen().asked:
            phone.press("#ask [value=yes]")
            phone.page.wait_for_selector(f"body:not(:has({selector})), {selector} .words:not([hidden])")

    def _until_other(self, phone: Phone, screen: Screen) -> None:
        """Wait until an answer has shown: another screen, words, or a question back."""
        wait_until(lambda: phone.screen() != screen or phone.page.wait_for_timeout(30), f"an answer at {screen}")

    def _at_once(self, selectors: dict[Phone, str]) -> None:
        """Press a button on each phone at the same moment."""
        moment_ms = time.time() * 1000 + 250
        for phone, selector in selectors.items():
            phone.click_at(selector, moment_ms)
        self.phones[0].page.wait_for_timeout(400)

    def _finish(self, phone: Phone, screen: Screen) -> None:
        phone.press("#finish-end")
        phone.press("#ask [value=yes]")
        wait_until(lambda: self.run.code is not None or phone.page.wait_for_timeout(50), "the session ends")


@contextmanager
def operators_at(
    rehearsal: Rehearsal,
    chance: random.Random,
    mishaps: list[tuple[str, Mishap]],
    names: Sequence[str] = ("Anna", "Ben"),
) -> Iterator[Operators]:
    """Start the run of a study and put people with phones beside it, two at most."""
    with ExitStack() as stack:
        people = list(zip(names, ("127.0.0.1", "localhost"), strict=False))
        relays = [stack.enter_context(TcpRelay(rehearsal.port, listens_for=TELLING)) for _ in people]
        routes = [(host, relay, rehearsal.port) for (_, host), relay in zip(people, relays, strict=True)]
        rehearsal.start()
        address = rehearsal.wait_served()
        browser = stack.enter_context(chromium_of_phones(*routes))
        phones = [phone_in(browser, *one, relay, address) for one, relay in zip(people, relays, strict=True)]
        yield Operators(rehearsal, phones, chance, mishaps)
