// The operator's page: everything on it is what the run said last, so a reload loses nothing.

import { get, Link, post } from "./link.js";
import { element, judgingForm, strip, sureOf } from "./judging.js";
import { showPlacing } from "./placing.js";
import { drawPlan, showOnPlan } from "./plan.js";
import { awaitingWords, isFormOpen, showEpisodes, showSummary } from "./episodes.js";

const at = (id) => document.getElementById(id);
const ARROWS = { MOVE_FORWARD: "↑", MOVE_BACKWARD: "↓", TURN_LEFT: "↶", TURN_RIGHT: "↷", STOP: "■", LOOK_UP: "△", LOOK_DOWN: "▽" };
const LIVE_EVERY_MS = 200;
let state = null;
let heardAt = 0;
let plan = null;
let planFails = false;
let screen = "";
let judged = "";
let pictureShown = 0;
let pictureBusy = false;
let pictureNext = 0; // the timer that asks for the next one

function show(id, visible) {
  at(id).hidden = !visible;
}

function say(text) {
  at("words").textContent = text;
  show("words", !!text);
}

async function doing(action) {
  say("");
  try {
    return await action();
  } catch (error) {
    say(error.answer ? error.message : "no answer from the run: is the phone on its network? Nothing was lost, try again");
    return null;
  }
}

const answer = (said) => doing(() => post("/answer", { question: state.question?.number ?? 0, said }));

function render() {
  if (!state) return;
  const { question, trial, driving } = state;
  const signedIn = !!state.you;
  const asks = question?.asks ?? "";
  at("label").textContent = state.label;
  const others = state.phones.filter((one) => !one.you).map((one) => one.name + (one.silent ? " (silent)" : ""));
  at("who").textContent = [state.you, others.length ? `also here: ${others.join(", ")}` : "", clockWords()].filter(Boolean).join(" · ");
  show("sign-in", !signedIn);
  const placing = asks === "begin" || asks === "place";
  show("trial", signedIn && !!trial && (placing || driving));
  if (trial) {
    at("trial-number").textContent = `#${trial.episode} · ${trial.driven_by} · ${state.done + 1} of ${state.trials}`;
    at("trial-goal").textContent = `Goal: ${trial.goal}, from mark ${trial.start}`;
    const [x, y] = trial.pose;
    at("trial-where").textContent = `${asks === "place" ? "Put the robot at" : "It stands at"} x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, facing ${Math.round(trial.heading_deg)}°${trial.note ? ` (${trial.note})` : ""}`;
  }
  show("trial-where", !driving); // it has left there
  at("trial-again").textContent = placing && state.last?.void ? `#${state.last.episode}: ${state.last.words}` : "";
  show("trial-again", !!at("trial-again").textContent);
  at("trial-problem").textContent = question?.problem ? `Not yet: ${question.problem}` : "";
  show("trial-problem", !!question?.problem);
  show("go-card", signedIn && placing);
  const { can_measure: canMeasure, green, seen, looking } = state.placing;
  const unchecked = asks === "place" && canMeasure && !green;
  at("go").textContent = asks !== "place" ? "Go" : !canMeasure ? "It stands there: go" : green ? "Go" : seen ? "Go all the same" : "Go without a check";
  at("go").className = unchecked ? "button" : "button go";
  at("go").disabled = !!state.paused_by || !!looking;
  showPlacing(at("placing"), at("placing-picture"), state, doing);
  at("pause").textContent = state.paused_by ? "Resume" : "Pause";
  show("plan-card", signedIn && (placing || driving) && (!!plan || planFails));
  if (plan) at("plan-words").textContent = showOnPlan(plan, state);
  else if (planFails) at("plan-words").textContent = "The floor plan of this site cannot be shown: find the mark by its number and by x and y above.";
  show("driving", signedIn && driving);
  at("driving-actions").textContent = trial ? `${state.actions} of ${trial.most_actions} actions` : "";
  at("driving-steps").textContent = state.steps.map(([name, blocked]) => (blocked ? "⊘" : ARROWS[name] ?? "·")).join("");
  at("driving-steps").scrollTop = 1e6;
  showStop(signedIn && (driving || looking === "turn"));
  const open = state.trials - state.done;
  at("skip").disabled = open <= 1; // there is no other to take first
  at("finish-words").textContent = open > 0 ? `${open} of ${state.trials} trials ${open === 1 ? "has" : "have"} no result: the same command takes ${open === 1 ? "it" : "them"} up again` : "No trial is left";
  show("finish", signedIn && (asks === "finish" || !!state.ended_by));
  show("corrections", !state.ended_by);
  show("finish-end", !state.ended_by);
  show("waiting", signedIn && !question && !driving && !state.ended_by);
  at("waiting-words").textContent = "The run is getting ready: nothing is asked right now.";
  if (state.paused_by && placing) say(`${state.paused_by} has paused the session.`);
  else if (at("words").textContent.endsWith("has paused the session.")) say("");
  renderJudging(signedIn && asks === "judge");
  renderPicture(signedIn && (driving || placing));
  show("episodes-card", signedIn && !state.ended_by);
  beginAtTheTop([signedIn, asks, driving, trial?.episode ?? 0].join());
}

// Another screen is read from its top, but whoever corrects an earlier episode is not taken from there.
function beginAtTheTop(now) {
  if (now === screen) return;
  screen = now;
  if (!isFormOpen()) scrollTo(0, 0);
}

function showStop(visible) {
  const appears = visible && at("stop-bar").hidden;
  show("stop-bar", visible);
  // Go has gone from under whoever works by keyboard: STOP takes its place, unless something is being typed.
  const held = document.activeElement;
  if (appears && (!held || held === document.body || !held.checkVisibility())) at("stop").focus({ preventScroll: true });
}

function renderJudging(visible) {
  show("judging", visible && !!state.case);
  if (!visible || !state.case) {
    judged = "";
    return;
  }
  const key = `judge-${state.case.episode}-${state.question.number}`;
  if (judged === key) return;
  judged = key;
  const [theCase, question] = [state.case, state.question.number];
  at("judging").replaceChildren(
    element("p", { class: "dim small" }, `#${theCase.episode} · ${theCase.ended_with === "stop" ? "the model said STOP" : `ended with ${theCase.ended_with.replace("_", " ")}`} after ${theCase.actions} actions`),
    element("h2", {}, "What happened?"),
    strip(theCase.episode, theCase.actions),
    element("p", { class: "verdict" }, `Proposed: ${theCase.proposal}`),
    judgingForm(theCase, {
      kept: `said-of-${theCase.episode}`,
      send: (word) => post("/judge", { question, episode: theCase.episode, ...word }).catch((error) => {
        if (error.status === 409) say(`#${theCase.episode}: ${error.message}`); // its screen goes, this stays
        throw error;
      }),
      later: async () => { if (await answer("later")) say(`#${theCase.episode} awaits its judgement: it stands in the list below.`); },
    }),
  );
}

async function renderPicture(visible) {
  show("picture", visible && pictureShown > 0 && state.driving);
  // Where the camera can be looked through while the robot moves, each picture asks for the next one.
  if (!visible || !state.driving || pictureBusy || pictureNext || (!state.live && state.picture === pictureShown)) return;
  pictureBusy = true;
  try {
    const fetched = await fetch(`/picture?number=${state.picture}`, { cache: "no-store", signal: AbortSignal.timeout(5000) });
    if (fetched.ok) {
      const number = state.picture;
      const old = at("picture-image").src;
      at("picture-image").src = URL.createObjectURL(await fetched.blob());
      if (old.startsWith("blob:")) URL.revokeObjectURL(old);
      pictureShown = Math.max(number, 1);
    }
  } catch {
    // the next state tries again
  } finally {
    pictureBusy = false;
    const next = () => {
      pictureNext = 0;
      renderPicture(!!state.you);
    };
    if (state.live && state.driving) pictureNext = setTimeout(next, LIVE_EVERY_MS);
  }
}

function clockWords() {
  const offMinutes = Math.round((Date.now() - Date.parse(state.now) - (performance.now() - heardAt)) / 60000);
  return Math.abs(offMinutes) >= 2 ? `this phone's clock is ${Math.abs(offMinutes)} min ${offMinutes > 0 ? "fast" : "slow"}: the computer's counts` : "";
}

function health(link) {
  const up = link.isUp;
  const badge = at("link");
  const over = !up && state?.ended_by;
  badge.className = `badge ${up ? "up" : over ? "" : "down"}`;
  badge.textContent = up ? `link ${link.roundTripMs === null ? "up" : `${Math.round(link.roundTripMs)} ms`}` : over ? "ended" : "NO LINK";
  at("offline").className = over ? "words" : "words alarm";
  at("offline").textContent = over
    ? `${over} has ended the session. The same command at the computer goes on where it was, and this page with it.`
    : "No link to the run. STOP on this phone does not reach the robot: use the robot's own switch or the terminal. What is typed here is kept.";
  show("offline", !up && heardAt > 0);
  at("stop").classList.toggle("cut", !up);
  if (!up && state?.driving) at("stop-words").textContent = "NO LINK: this button may not reach the robot";
  else if (at("stop-words").textContent.startsWith("NO LINK")) at("stop-words").textContent = "";
}

const link = new Link(
  (said) => {
    const before = state;
    state = said;
    heardAt = performance.now();
    if (!before?.driving && state.driving) at("stop-words").textContent = "";
    render();
    showEpisodes(at("episodes"), state, before, say);
    if (state.question?.asks === "finish" || state.ended_by) showSummary(at("summary"), state, before);
    if (!plan) drawPlan(at("plan")).then((made) => { plan = made; render(); }).catch(() => { planFails = true; render(); });
    if (before === null) get("/state").catch(() => {});
  },
  health,
  (words) => { at("stop-words").textContent = words; },
);

at("sign-in-form").addEventListener("submit", (event) => {
  event.preventDefault();
  doing(async () => {
    await get("/state");
    await post("/sign-in", { name: at("name").value });
    await get("/state");
    link.reconnect();
  });
});
at("go").addEventListener("click", () => answer("go"));
at("skip").addEventListener("click", async () => {
  const { start } = state.trial;
  if (await answer("skip")) say(`Mark ${start} comes later.`);
});
at("pause").addEventListener("click", () => doing(() => post("/pause", { pause: !state.paused_by })));
for (const id of ["end", "finish-end"]) {
  at(id).addEventListener("click", async () => {
    await showSummary(at("summary"), state, null); // it is shown to the last, when the run is there no more
    const left = state.trials > state.done ? " The same command goes on with what is left." : "";
    if (await sureOf(`End the session?${awaitingWords()}${left}`)) answer("end");
  });
}
const stop = () => {
  at("stop-words").textContent = "stopping …";
  link.stop().then((said) => { at("stop-words").textContent = said.words; }).catch((error) => {
    at("stop-words").textContent = error.answer ? error.message : "NO LINK: this button may not reach the robot";
  });
};
at("stop").addEventListener("pointerdown", stop);
// A key that is still held from Go is no new word.
at("stop").addEventListener("keydown", (event) => { if (!event.repeat && (event.key === "Enter" || event.key === " ")) stop(); });
setInterval(() => {
  if (state?.driving && state.for_s !== null) {
    at("driving-for").textContent = `${Math.round(state.for_s + (performance.now() - heardAt) / 1000)} s`;
  }
}, 500);
get("/state").catch((error) => { if (error.status === 403) say("This page needs its whole address again: scan the code at the terminal."); });
