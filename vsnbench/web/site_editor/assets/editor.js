// The site editor's page: connects plan, tools and panel, and checks and saves the site.

import { GoalCard } from "./goals.js";
import { Model, SIZES, outline, rounded } from "./model.js";
import { Panel } from "./panel.js";
import { Plan } from "./plan.js";
import { TOOLS, Tools } from "./tools.js";
import { UnderlayCard } from "./underlay.js";

const at = (id) => document.getElementById(id);
const showHint = (text) => { at("hint").textContent = text; };
let state;
let model;
let plan;
let panel;
let tools;
let underlay;
let goals;
let isDirty = false;
let changes = 0;
let pointed = null; // where the pointer was last on the plan

async function post(path, content) {
  const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json", "X-CSRF-Token": state.csrf_token }, body: JSON.stringify(content) });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).message ?? `the server answered ${answer.status}`);
  return answer;
}

// Returns a function that runs `act` once, `delay` ms after its last call.
function debounced(act, delay) {
  let timer = null;
  let running = false;
  let again = false;
  const run = async () => {
    if (running) { again = true; return; }
    running = true;
    try { await act(); } catch (error) { showHint(error.message); } finally {
      running = false;
      if (again) { again = false; run(); }
    }
  };
  return () => { clearTimeout(timer); timer = setTimeout(run, delay); };
}

const check = debounced(async () => {
  const checked = changes;
  const { findings } = await (await post("/check", { site: model.site })).json();
  panel.showFindings(findings);
  goals.findings = findings;
  if (side.isPressed) side.isWaiting = true;
  else goals.show(); // not the form, in which a value is perhaps being typed
  if (checked === changes) document.body.dataset.checked = "yes";
}, 250);

const preview = debounced(async () => {
  const entry = model.entry();
  const start = model.selected?.[0] === "starts" ? { x_m: entry.position[0], y_m: entry.position[1], heading_deg: entry.heading_deg ?? 0 } : null;
  const pose = start ?? goals.shownCamera();
  at("preview-card").hidden = !pose;
  if (!pose) return;
  at("preview").alt = start ? "Camera image from the selected start" : "Camera image for the photograph of the goal";
  await showPicture(at("preview"), await post("/preview", { site: model.site, ...pose }));
}, 60);

// The scan from above around the pointer, on the side of the plan where the pointer is not.
const showScan = debounced(async () => {
  const [x, y] = pointed;
  const answer = await post("/scan-view", { site: model.site, x_m: x, y_m: y, heading_deg: 0 });
  const height = answer.headers.get("Surface-Height-M");
  at("scan-height").textContent = height === null ? "hole in the scan" : `scan: ${height} m high`;
  at("scan-picture").alt = `The scan from above around (${x.toFixed(2)}, ${y.toFixed(2)})`;
  at("scan-view").classList.toggle("left", x > plan.centre()[0]);
  at("scan-view").hidden = false;
  await showPicture(at("scan-picture"), answer);
}, 60);

async function showPicture(image, answer) {
  const picture = await answer.blob();
  URL.revokeObjectURL(image.src);
  image.src = URL.createObjectURL(picture);
}

function setUnsaved() {
  isDirty = true;
  at("saved").textContent = `${state.path}: not saved`;
}

function changed() {
  changes += 1;
  document.body.dataset.checked = "no";
  setUnsaved();
  plan.highlight = null;
  render();
  check();
  preview();
}

// Draws the side panel. While the mouse or Tab is down on it, drawing waits: a press that also ends the input of a value
// must find its button again when it is released, and Tab the next field.
const side = {
  isPressed: false,
  isWaiting: false,
  draw() {
    if (side.isPressed) { side.isWaiting = true; return; }
    side.isWaiting = false;
    panel.showSelection();
    panel.showAll();
    goals.show();
  },
  release() {
    side.isPressed = false;
    if (side.isWaiting) side.draw();
  },
};

function render() {
  plan.draw();
  side.draw();
  at("undo").disabled = !model.past.length;
  at("redo").disabled = !model.future.length;
}

async function save() {
  try {
    const answer = await (await post("/save", { site: model.site, underlay: underlay.content() })).json();
    model.renumber(answer.site);
    isDirty = false;
    at("saved").textContent = `${answer.path}: saved`;
    render();
  } catch (error) {
    at("saved").textContent = "";
    showHint(`Not saved: ${error.message}`);
  }
}

function toolbar() {
  const bar = at("tools");
  const heading = (text) => bar.append(Object.assign(document.createElement("h2"), { textContent: text }));
  const button = (name, text) => {
    const key = Object.assign(document.createElement("button"), { type: "button", className: "key", textContent: text });
    key.dataset.tool = name;
    key.setAttribute("aria-pressed", String(name === tools.tool));
    key.addEventListener("click", (event) => {
      tools.use(name);
      if (event.detail === 0 && name !== "select") tools.addInView(); // chosen with the keyboard: there is no pointer to follow
      plan.svg.focus({ preventScroll: true });
    });
    bar.append(key);
  };
  heading("Draw");
  for (const [name, text] of TOOLS) button(name, text);
  heading("Goal objects");
  for (const name of state.goals) button(name, name);
  heading("Furniture");
  for (const name of Object.keys(SIZES).filter((each) => !state.goals.includes(each)).sort()) button(name, name.replaceAll("_", " "));
}

function wire() {
  model.addEventListener("change", changed);
  model.addEventListener("selection", () => {
    if (tools.isForGoal && model.selected?.[0] !== "goals") tools.use("select");
    render();
    preview();
  });
  tools.onUse = (tool) => {
    for (const key of at("tools").querySelectorAll("button")) key.setAttribute("aria-pressed", String(key.dataset.tool === tool));
    side.draw();
  };
  goals.onCamera = () => { plan.draw(); side.draw(); preview(); };
  const aside = document.querySelector(".side");
  aside.addEventListener("mousedown", () => { side.isPressed = true; }, true);
  aside.addEventListener("change", (event) => { if (event.target.matches("select")) side.isPressed = false; }, true); // its list swallows the release
  window.addEventListener("click", side.release); // after the listeners of what was clicked
  aside.addEventListener("keydown", (event) => { if (event.key === "Tab") side.isPressed = true; }, true);
  window.addEventListener("keyup", side.release); // the next field has the focus
  for (const end of ["mouseup", "blur"]) window.addEventListener(end, () => setTimeout(side.release));
  for (const moved of ["pointermove", "pointerdown"]) plan.svg.addEventListener(moved, (event) => {
    pointed = plan.at(event);
    if (model.site.scan) showScan();
  });
  plan.camera = () => goals.shownCamera();
  plan.onSettled = preview;
  plan.outlineOf = (entry) => outline(entry).map((point) => point.map((each) => rounded(each)));
  at("undo").addEventListener("click", () => model.undo());
  at("redo").addEventListener("click", () => model.redo());
  at("zoom-in").addEventListener("click", () => plan.zoom(0.8));
  at("zoom-out").addEventListener("click", () => plan.zoom(1.25));
  at("fit").addEventListener("click", () => plan.fit());
  at("save").addEventListener("click", save);
  underlay.onChange = setUnsaved;
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey)) return;
    const act = { z: () => (event.shiftKey ? model.redo() : model.undo()), y: () => model.redo(), s: save }[event.key.toLowerCase()];
    if (!act || (event.target.matches("input, textarea") && event.key.toLowerCase() !== "s")) return;
    event.preventDefault();
    act();
  });
  new ResizeObserver(() => plan.draw()).observe(plan.svg);
  window.addEventListener("beforeunload", (event) => { if (isDirty) event.preventDefault(); });
}

async function open() {
  state = await (await fetch("/state")).json();
  model = new Model(state.site);
  plan = new Plan(at("plan"), model);
  plan.goals = new Set(state.goals);
  panel = new Panel(model, plan, state);
  tools = new Tools(plan, model, showHint);
  goals = new GoalCard(model, plan, tools, panel, { showHint, post });
  underlay = new UnderlayCard(model, plan, showHint, post);
  at("title").textContent = `Site ${state.site.name}`;
  at("saved").textContent = state.path;
  toolbar();
  wire();
  if (state.underlay) underlay.show(state.underlay);
  plan.fit();
  render();
  check();
  tools.use("select");
  document.body.dataset.open = "yes";
}

open().catch((error) => showHint(error.message));
