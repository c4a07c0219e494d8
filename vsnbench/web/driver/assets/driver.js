// The driver's page: shows the robot's camera, and sends one action for each picture.

import { Connection, NO_ANSWER, get, post } from "/operator/connection.js";

const at = (id) => document.getElementById(id);
const KEYS = { ArrowUp: "MOVE_FORWARD", ArrowDown: "MOVE_BACKWARD", ArrowLeft: "TURN_LEFT", ArrowRight: "TURN_RIGHT", Enter: "STOP", " ": "STOP" };
const ACTIONS = ["TURN_LEFT", "MOVE_FORWARD", "TURN_RIGHT", "MOVE_BACKWARD", "STOP"];
// Of the standard layout: the cross, and the lowest of the four buttons on the right.
const PAD_BUTTONS = { 0: "STOP", 12: "MOVE_FORWARD", 13: "MOVE_BACKWARD", 14: "TURN_LEFT", 15: "TURN_RIGHT" };
const STICK = 0.6;
const STATUS = { preparing: "The next trial is being prepared.", moving: "The robot moves.", ended: "The session has ended. Thank you." };
const REFUSED = "The guard refused. Choose again.";
let state = null;
let connection = null;
let shown = 0; // number of the picture that is on the screen
let loading = 0;
let answered = 0; // number of the picture whose action was sent
let wasTakable = false;
let heldPad = new Set(["STOP"]); // a button that is already held when the page loads does not count as a press

const isMine = () => state?.controls === "yours";
const canChoose = () => isMine() && state.phase === "choosing" && shown === state.picture && answered !== state.picture;

function show(id, isVisible) {
  at(id).hidden = !isVisible;
}

function showMessage(text) {
  at("message").textContent = text;
  show("message", !!text);
}

function render() {
  const { phase, goal, driver, controls } = state;
  const isDriving = isMine() && (phase === "choosing" || phase === "moving");
  const canTake = phase === "ready" ? controls !== "taken" : controls === "free" && (phase === "choosing" || phase === "moving");
  const words = state.has_photo ? "the place in the photograph" : goal;
  at("goal").textContent = state.trial && phase !== "ended" ? `Goal: ${words}` : "vsnbench";
  at("left").textContent = isDriving ? leftText() : "";
  show("practice", state.practice && phase !== "ended");
  show("start", canTake);
  at("start-goal").textContent = `Goal: ${words}`;
  at("start-rule").textContent = state.success_distance_m === null ? "press it at the goal." : `press it with the goal in sight and less than ${state.success_distance_m} m away.`;
  at("start-driver").textContent = `You drive as ${driver}: the name is recorded with the trial.`;
  at("begin").textContent = phase === "ready" ? "Begin" : "Take the controls";
  show("picture", isDriving && shown > 0);
  show("goal-photo", isMine() && state.has_photo && (isDriving || phase === "ready"));
  if (isMine() && state.has_photo && at("goal-photo-image").dataset.goal !== `${state.trial}.${state.leg}`) {
    at("goal-photo-image").dataset.goal = `${state.trial}.${state.leg}`;
    at("goal-photo-image").src = `/goal-photo?trial=${state.trial}.${state.leg}`;
  }
  show("pad", isDriving);
  if (canTake && !wasTakable && document.activeElement === document.body) at("begin").focus({ preventScroll: true });
  wasTakable = canTake;
  at("picture").classList.toggle("waits", !canChoose());
  for (const action of ACTIONS) {
    at(action).setAttribute("aria-disabled", String(!canChoose()));
    if (canChoose()) at(action).classList.remove("pressed");
  }
  const taken = controls === "taken" && phase !== "ended";
  const isRefused = canChoose() && state.refused;
  at("status").classList.toggle("refused", isRefused);
  at("status").textContent = isRefused ? REFUSED : taken ? `${driver} drives this robot in another browser.` : isMine() && phase === "choosing" ? (answered === state.picture ? STATUS.moving : "Choose an action.") : canTake ? "" : STATUS[phase] ?? "";
}

function leftText() {
  const parts = [];
  if (state.actions_left !== null) parts.push(`${state.actions_left} action${state.actions_left === 1 ? "" : "s"} left`);
  if (state.time_left_s !== null) parts.push(`${Math.round(state.time_left_s)} s left`);
  if (state.path_left_m !== null) parts.push(`${state.path_left_m.toFixed(1)} m left`);
  return parts.join(", ");
}

async function loadPicture() {
  const { picture, phase } = state;
  if (!isMine() || phase !== "choosing" || picture === shown || picture === loading) return;
  loading = picture;
  try {
    const fetched = await fetch(`/picture?number=${picture}`, { cache: "no-store", signal: AbortSignal.timeout(5000) });
    if (!fetched.ok) return;
    const image = at("picture-image");
    const old = image.src;
    image.src = URL.createObjectURL(await fetched.blob());
    await image.decode();
    if (old.startsWith("blob:")) URL.revokeObjectURL(old);
    shown = picture;
    connection.socket.send(JSON.stringify({ shown: picture }));
    render();
  } catch {
    // the next state tries again
  } finally {
    loading = 0;
  }
}

async function run(action) {
  showMessage("");
  try {
    await action();
    return true;
  } catch (error) {
    showMessage(error.answer ? error.message : NO_ANSWER);
    return false;
  }
}

async function choose(action) {
  if (!canChoose()) return;
  const picture = state.picture;
  answered = picture;
  at(action).classList.add("pressed");
  render();
  if (!(await run(() => post("/choose", { picture, action }))) && answered === picture) answered = 0;
}

const begin = () => run(() => post("/take"));

function showStatus(link) {
  const hasEnded = !link.isUp && state?.phase === "ended";
  at("link").className = `badge ${link.isUp ? "up" : hasEnded ? "" : "down"}`;
  show("offline", !link.isUp && !hasEnded && state !== null);
  at("link").textContent = link.isUp ? `connected${link.roundTripMs === null ? "" : ` ${Math.round(link.roundTripMs)} ms`}` : hasEnded ? "ended" : "NOT CONNECTED";
}

function receive(newState) {
  if (newState.picture < Math.max(shown, answered)) shown = answered = 0; // the page has outlived a run
  state = newState;
  render();
  loadPicture();
}

at("begin").addEventListener("click", begin);
// A repeated event comes from the key that ended the last trial and is still held.
at("begin").addEventListener("keydown", (event) => { if (event.repeat) event.preventDefault(); });
for (const action of ACTIONS) {
  at(action).addEventListener("pointerdown", (event) => event.preventDefault()); // a click leaves the keys to the page
  at(action).addEventListener("click", () => choose(action));
}
addEventListener("keydown", (event) => {
  const action = KEYS[event.key];
  if (!action || event.altKey || event.ctrlKey || event.metaKey || !isMine() || at("pad").hidden) return;
  const focused = document.activeElement;
  if (action === "STOP" && focused?.matches("button:focus-visible")) return; // the key presses this button
  event.preventDefault();
  if (event.repeat && (action === "STOP" || state.refused)) return; // a held key does not end a trial, nor ask again
  choose(action);
});

function pollGamepads() {
  const pads = [...navigator.getGamepads()].filter(Boolean);
  const pressed = new Set();
  for (const pad of pads) {
    for (const [button, action] of Object.entries(PAD_BUTTONS)) if (pad.buttons[button]?.pressed) pressed.add(action);
    const [x = 0, y = 0] = pad.axes;
    if (Math.abs(x) > STICK && Math.abs(x) >= Math.abs(y)) pressed.add(x < 0 ? "TURN_LEFT" : "TURN_RIGHT");
    else if (Math.abs(y) > STICK) pressed.add(y < 0 ? "MOVE_FORWARD" : "MOVE_BACKWARD");
  }
  for (const action of pressed) {
    if (heldPad.has(action) && (action === "STOP" || state?.refused)) continue;
    if (action === "STOP" && state?.phase === "ready" && !at("start").hidden) begin();
    else choose(action);
  }
  heldPad = pressed;
  if (pads.length) requestAnimationFrame(pollGamepads);
}
addEventListener("gamepadconnected", () => requestAnimationFrame(pollGamepads));
// The first answer has the token that every action needs.
get("/state")
  .catch((error) => { if (error.status === 403) showMessage("This address has expired. Open the one shown in the terminal."); })
  .finally(() => { connection = new Connection(receive, showStatus, () => {}); });
