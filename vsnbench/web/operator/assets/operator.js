// The operator's page. It draws the state that the server sends, so a reload loses nothing.

import { Connection, NO_ANSWER, get, post } from "./connection.js";
import { askToConfirm, draftKeyOf, element, frameStrip, judgingForm } from "./judging.js";
import { awaitingText, isFormOpen, showEpisodes, showSummary } from "./episodes.js";
import { drawState, loadPlan } from "./plan.js";
import { keepFocus } from "./focus.js";
import { showPlacing } from "./placing.js";

const at = (id) => document.getElementById(id);
const ARROWS = { MOVE_FORWARD: "↑", MOVE_BACKWARD: "↓", TURN_LEFT: "↶", TURN_RIGHT: "↷", STOP: "■", LOOK_UP: "△", LOOK_DOWN: "▽" };
const CAMERA_INTERVAL_MS = 200;
const DISCONNECTED_STOP = "NOT CONNECTED: this button may not reach the robot";
const PAUSED = "paused the session.";
let state = null;
let receivedAt = 0;
let plan = null;
let planFailed = false;
let screen = "";
let judgedKey = "";
let shownPicture = 0;
let isLoadingPicture = false;
let pictureTimer = 0;

function show(id, isVisible) {
  at(id).hidden = !isVisible;
}

function showMessage(text) {
  at("message").textContent = text;
  show("message", !!text);
}

// Runs an action and shows its error; returns null if it fails.
async function run(action) {
  showMessage("");
  try {
    return await action();
  } catch (error) {
    showMessage(error.answer ? error.message : NO_ANSWER);
    return null;
  }
}

const answer = (choice) => run(() => post("/answer", { question: state.question?.number ?? 0, answer: choice }));

function render() {
  if (!state) return;
  const { question, trial, driving } = state;
  const isSignedIn = !!state.you;
  const kind = question?.kind ?? "";
  const isPlacing = kind === "begin" || kind === "place";
  renderHeader();
  show("sign-in", !isSignedIn);
  show("trial", isSignedIn && !!trial && (isPlacing || driving));
  if (trial) renderTrial(trial, kind);
  show("trial-where", !driving);
  const repeats = isPlacing && state.last?.is_void;
  at("trial-again").textContent = repeats ? `#${state.last.episode}: ${state.last.verdict}` : "";
  show("trial-again", !!repeats);
  at("trial-problem").textContent = question?.problem ? `Not ready: ${question.problem}` : "";
  show("trial-problem", !!question?.problem);
  show("go-card", isSignedIn && isPlacing);
  renderGo(kind);
  show("plan-card", isSignedIn && (isPlacing || driving) && (!!plan || planFailed));
  if (plan) at("plan-caption").textContent = drawState(plan, state);
  else if (planFailed) at("plan-caption").textContent = "The floor plan cannot be shown. Find the mark by its number and its position above.";
  show("driving", isSignedIn && driving);
  at("driving-actions").textContent = state.waits_for ? `${state.waits_for} has not begun to drive yet.` : trial ? budgetText(trial) : "";
  at("driving-steps").textContent = state.steps.map(([name, isBlocked]) => (isBlocked ? "⊘" : ARROWS[name] ?? "·")).join("");
  at("driving-steps").scrollTop = 1e6;
  show("where", state.can_measure);
  show("arrived", state.can_declare);
  at("where-text").textContent = state.whereabouts;
  showStop(isSignedIn && (driving || state.placing.in_progress === "turn"));
  renderFinish(isSignedIn, kind);
  show("waiting", isSignedIn && !question && !driving && !state.ended_by);
  if (state.paused_by && isPlacing) showMessage(`${state.paused_by} ${PAUSED}`);
  else if (at("message").textContent.endsWith(PAUSED)) showMessage("");
  renderJudging(isSignedIn && kind === "judge");
  renderPicture(isSignedIn && (driving || isPlacing));
  show("episodes-card", isSignedIn && !state.ended_by);
  scrollToTop([isSignedIn, kind, driving, trial?.episode ?? 0].join());
}

function budgetText(trial) {
  const parts = [`${state.actions} of ${trial.max_actions} actions`];
  if (trial.max_time_s) parts.push(`${Math.max(0, Math.round(trial.max_time_s - state.time_s))} of ${trial.max_time_s} s left`);
  if (trial.max_path_m) parts.push(`${Math.max(0, trial.max_path_m - state.path_m).toFixed(1)} of ${trial.max_path_m} m left`);
  return parts.join(", ");
}

function renderHeader() {
  at("label").textContent = state.label;
  const others = state.clients.filter((client) => !client.is_you).map((client) => client.name + (client.is_silent ? " (not connected)" : ""));
  at("who").textContent = [state.you, others.length ? `also here: ${others.join(", ")}` : "", clockText()].filter(Boolean).join(" · ");
}

function renderTrial(trial, kind) {
  at("trial-number").textContent = `#${trial.episode} · ${trial.driven_by} · trial ${state.done + 1} of ${state.trials}`;
  at("trial-goal").textContent = `Goal: ${trial.goal_words}, from mark ${trial.start}`;
  const [x, y] = trial.pose;
  const note = trial.note ? ` (${trial.note})` : "";
  at("trial-where").textContent = `${kind === "place" ? "Put the robot at" : "The robot is at"} x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, heading ${Math.round(trial.heading_deg)}°${note}`;
}

function renderGo(kind) {
  const { can_measure: canMeasure, within_tolerance: isInPlace, is_measured: isMeasured, in_progress: inProgress } = state.placing;
  const isUnchecked = kind === "place" && canMeasure && !isInPlace;
  at("go").textContent = isUnchecked ? (isMeasured ? "Start anyway" : "Start without checking") : kind === "place" && !canMeasure ? "Robot is in place. Start" : "Start";
  at("go").className = isUnchecked ? "button" : "button go";
  at("go").disabled = !!state.paused_by || !!inProgress;
  at("skip").disabled = state.trials - state.done <= 1; // there is no other trial
  at("pause").textContent = state.paused_by ? "Resume" : "Pause";
  showPlacing(at("placing"), at("placing-picture"), state, run);
}

function renderFinish(isSignedIn, kind) {
  const left = state.trials - state.done;
  at("finish-text").textContent = left > 0 ? `${left} of ${state.trials} trials ${left === 1 ? "has" : "have"} no result. The same command continues.` : "All trials have a result";
  show("finish", isSignedIn && (kind === "finish" || !!state.ended_by));
  show("corrections", !state.ended_by);
  show("finish-end", !state.ended_by);
}

// A new screen starts at its top, except while the operator corrects an earlier episode.
function scrollToTop(newScreen) {
  if (newScreen === screen) return;
  screen = newScreen;
  if (!isFormOpen()) scrollTo(0, 0);
}

function showStop(isVisible) {
  const appears = isVisible && at("stop-bar").hidden;
  show("stop-bar", isVisible);
  // For keyboard users, STOP takes the focus of the Start button that has disappeared.
  const focused = document.activeElement;
  if (appears && (!focused || focused === document.body || !focused.checkVisibility())) at("stop").focus({ preventScroll: true });
}

function renderJudging(isVisible) {
  show("judging", isVisible && !!state.case);
  if (!isVisible || !state.case) {
    judgedKey = "";
    return;
  }
  const [theCase, question] = [state.case, state.question.number];
  const key = `judge-${theCase.episode}-${question}`;
  if (judgedKey === key) return;
  judgedKey = key;
  const ending = theCase.ended_with === "stop" ? "the model chose STOP" : `ended by ${theCase.ended_with.replaceAll("_", " ")}`;
  const parts = [
    element("p", { class: "dim small" }, `#${theCase.episode} · ${ending} after ${theCase.actions} actions`),
    element("h2", {}, `Goal: ${theCase.goal}, from mark ${theCase.start}`),
    frameStrip(theCase.episode, theCase.actions),
    element("p", { class: "verdict" }, `Proposed: ${theCase.proposal}`),
    judgingForm(theCase, {
      draftKey: draftKeyOf(theCase.episode),
      send: (form) => post("/judge", { question, episode: theCase.episode, ...form }).catch((error) => {
        if (error.status === 409) showMessage(`#${theCase.episode}: ${error.message}`); // the form disappears, this stays
        throw error;
      }),
      postpone: async () => { if (await answer("later")) showMessage(`#${theCase.episode} awaits a judgement in the list below.`); },
    }),
  ];
  keepFocus(at("judging"), () => at("judging").replaceChildren(...parts));
}

async function renderPicture(isVisible) {
  show("picture", isVisible && shownPicture > 0 && state.driving);
  // With a live camera each image requests the next one.
  if (!isVisible || !state.driving || isLoadingPicture || pictureTimer || (!state.has_live_camera && state.picture === shownPicture)) return;
  isLoadingPicture = true;
  try {
    const fetched = await fetch(`/picture?number=${state.picture}`, { cache: "no-store", signal: AbortSignal.timeout(5000) });
    if (fetched.ok) {
      const number = state.picture;
      const old = at("picture-image").src;
      at("picture-image").src = URL.createObjectURL(await fetched.blob());
      if (old.startsWith("blob:")) URL.revokeObjectURL(old);
      shownPicture = Math.max(number, 1);
    }
  } catch {
    // the next state tries again
  } finally {
    isLoadingPicture = false;
    const next = () => {
      pictureTimer = 0;
      renderPicture(!!state.you);
    };
    if (state.has_live_camera && state.driving) pictureTimer = setTimeout(next, CAMERA_INTERVAL_MS);
  }
}

function clockText() {
  const offset = Math.round((Date.now() - Date.parse(state.now) - (performance.now() - receivedAt)) / 60000);
  return Math.abs(offset) >= 2 ? `this phone's clock is ${Math.abs(offset)} min ${offset > 0 ? "fast" : "slow"}; the computer's clock is used` : "";
}

function showStatus(connection) {
  const { isUp, roundTripMs } = connection;
  const hasEnded = !isUp && state?.ended_by;
  const badge = at("link");
  badge.className = `badge ${isUp ? "up" : hasEnded ? "" : "down"}`;
  badge.textContent = isUp ? `connected${roundTripMs === null ? "" : ` ${Math.round(roundTripMs)} ms`}` : hasEnded ? "ended" : "NOT CONNECTED";
  at("offline").className = hasEnded ? "notice" : "notice alarm";
  at("offline").textContent = hasEnded
    ? `${hasEnded} ended the session. Run the same command on the computer to continue; this page then reconnects.`
    : "Not connected. STOP on this phone does not reach the robot: use the robot's own switch or the terminal. Your input is kept.";
  show("offline", !isUp && receivedAt > 0);
  at("stop").classList.toggle("cut", !isUp);
  if (!isUp && state?.driving) at("stop-text").textContent = DISCONNECTED_STOP;
  else if (at("stop-text").textContent === DISCONNECTED_STOP) at("stop-text").textContent = "";
}

const connection = new Connection(
  (newState) => {
    const before = state;
    state = newState;
    receivedAt = performance.now();
    if (!before?.driving && state.driving) at("stop-text").textContent = "";
    render();
    showEpisodes(at("episodes"), state, before, showMessage);
    if (state.question?.kind === "finish" || state.ended_by) showSummary(at("summary"), state, before);
    if (!plan) loadPlan(at("plan")).then((loaded) => { plan = loaded; render(); }).catch(() => { planFailed = true; render(); });
    if (before === null) get("/state").catch(() => {});
  },
  showStatus,
  (text) => { at("stop-text").textContent = text; },
);

at("sign-in-form").addEventListener("submit", (event) => {
  event.preventDefault();
  run(async () => {
    await get("/state");
    await post("/sign-in", { name: at("name").value });
    await get("/state");
    connection.reconnect();
  });
});
at("go").addEventListener("click", () => answer("go"));
at("skip").addEventListener("click", async () => {
  const { start } = state.trial;
  if (await answer("skip")) showMessage(`The trial from mark ${start} comes later.`);
});
at("pause").addEventListener("click", () => run(() => post("/pause", { pause: !state.paused_by })));
at("arrived").addEventListener("click", () => run(() => post("/arrived", {})));
at("where").addEventListener("click", () => run(() => post("/where", {})));
for (const id of ["end", "finish-end"]) {
  at(id).addEventListener("click", async () => {
    await showSummary(at("summary"), state, null); // loaded now, because the server stops with the session
    const left = state.trials > state.done ? " The same command continues with the remaining trials." : "";
    if (await askToConfirm(`End the session?${await awaitingText()}${left}`)) answer("end");
  });
}
const stop = () => {
  at("stop-text").textContent = "stopping …";
  connection.stop().then(({ message }) => { at("stop-text").textContent = message; }).catch((error) => {
    at("stop-text").textContent = error.answer ? error.message : DISCONNECTED_STOP;
  });
};
at("stop").addEventListener("pointerdown", stop);
// A repeated event comes from the key that pressed Start and is still held.
at("stop").addEventListener("keydown", (event) => { if (!event.repeat && (event.key === "Enter" || event.key === " ")) stop(); });
setInterval(() => {
  if (state?.driving && state.elapsed_s !== null) {
    at("driving-for").textContent = `${Math.round(state.elapsed_s + (performance.now() - receivedAt) / 1000)} s`;
  }
}, 500);
get("/state").catch((error) => { if (error.status === 403) showMessage("The address is no longer valid. Scan the code on the terminal again."); });
