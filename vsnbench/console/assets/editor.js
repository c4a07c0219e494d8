// The site editor's page: opens the site, puts plan, tools and panel together, checks and saves.

import { Model, SIZES, outline, rounded } from "./editor-model.js";
import { Panel } from "./editor-panel.js";
import { Plan } from "./editor-plan.js";
import { TOOLS, Tools } from "./editor-tools.js";
import { UnderlayCard } from "./editor-underlay.js";

const by = (id) => document.getElementById(id);
const say = (words) => { by("hint").textContent = words; };
let state;
let model;
let plan;
let panel;
let tools;
let underlay;
let isDirty = false;

async function post(path, said) {
  const answer = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json", "X-Vsnbench-Proof": state.proof }, body: JSON.stringify(said) });
  if (!answer.ok) throw new Error((await answer.json().catch(() => ({}))).words ?? `the server answered ${answer.status}`);
  return answer;
}

function later(act, delay) {
  let timer = null;
  let running = false;
  let again = false;
  const run = async () => {
    if (running) { again = true; return; }
    running = true;
    try { await act(); } catch (error) { say(error.message); } finally {
      running = false;
      if (again) { again = false; run(); }
    }
  };
  return () => { clearTimeout(timer); timer = setTimeout(run, delay); };
}

const check = later(async () => {
  document.body.dataset.checked = "no";
  const { findings } = await (await post("/check", { site: model.site })).json();
  panel.showFindings(findings);
  document.body.dataset.checked = "yes";
}, 250);

const look = later(async () => {
  const entry = model.entry();
  by("look-card").hidden = model.chosen?.[0] !== "starts";
  if (by("look-card").hidden) return;
  const said = { site: model.site, x_m: entry.position[0], y_m: entry.position[1], heading_deg: entry.heading_deg ?? 0 };
  const image = await (await post("/look", said)).blob();
  URL.revokeObjectURL(by("look").src);
  by("look").src = URL.createObjectURL(image);
}, 60);

function unsaved() {
  isDirty = true;
  by("saved").textContent = `${state.path}: not saved`;
}

function changed() {
  unsaved();
  plan.lit = null;
  shown();
  check();
  look();
}

function shown() {
  plan.draw();
  panel.showChosen();
  panel.showAll();
  by("undo").disabled = !model.past.length;
  by("redo").disabled = !model.future.length;
}

async function save() {
  try {
    const answer = await (await post("/save", { site: model.site, underlay: underlay.content() })).json();
    model.renumber(answer.site);
    isDirty = false;
    by("saved").textContent = `${answer.saved}: saved`;
    shown();
  } catch (error) {
    by("saved").textContent = "";
    say(`Not saved: ${error.message}`);
  }
}

function toolbar() {
  const bar = by("tools");
  const heading = (words) => bar.append(Object.assign(document.createElement("h2"), { textContent: words }));
  const button = (name, words) => {
    const key = Object.assign(document.createElement("button"), { type: "button", className: "key", textContent: words });
    key.dataset.tool = name;
    key.setAttribute("aria-pressed", String(name === tools.tool));
    key.addEventListener("click", (event) => {
      tools.use(name);
      for (const other of bar.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === key));
      if (event.detail === 0 && name !== "choose") tools.place(); // chosen by keyboard: there is no pointer to say where
      plan.svg.focus({ preventScroll: true });
    });
    bar.append(key);
  };
  heading("Draw");
  for (const [name, words] of TOOLS) button(name, words);
  heading("Goals");
  for (const name of state.goals) button(name, name);
  heading("Furniture");
  for (const name of Object.keys(SIZES).filter((each) => !state.goals.includes(each)).sort()) button(name, name.replaceAll("_", " "));
}

function wire() {
  model.addEventListener("change", changed);
  model.addEventListener("choice", () => { shown(); look(); });
  plan.onSettled = look;
  plan.outlineOf = (entry) => outline(entry).map((point) => point.map((each) => rounded(each)));
  by("undo").addEventListener("click", () => model.undo());
  by("redo").addEventListener("click", () => model.redo());
  by("zoom-in").addEventListener("click", () => plan.zoom(0.8));
  by("zoom-out").addEventListener("click", () => plan.zoom(1.25));
  by("fit").addEventListener("click", () => plan.fit());
  by("save").addEventListener("click", save);
  underlay.onAltered = unsaved;
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey)) return;
    const act = { z: () => (event.shiftKey ? model.redo() : model.undo()), y: () => model.redo(), s: save }[event.key.toLowerCase()];
    if (!act || (event.target.matches("input") && event.key.toLowerCase() !== "s")) return;
    event.preventDefault();
    act();
  });
  new ResizeObserver(() => plan.draw()).observe(plan.svg);
  window.addEventListener("beforeunload", (event) => { if (isDirty) event.preventDefault(); });
}

async function open() {
  state = await (await fetch("/state")).json();
  model = new Model(state.site);
  plan = new Plan(by("plan"), model);
  plan.goals = new Set(state.goals);
  panel = new Panel(model, plan, state);
  tools = new Tools(plan, model, say);
  underlay = new UnderlayCard(model, plan, say, post);
  by("title").textContent = `Site ${state.site.name}`;
  by("saved").textContent = state.path;
  toolbar();
  wire();
  if (state.underlay) underlay.show(state.underlay);
  plan.fit();
  shown();
  check();
  tools.use("choose");
  document.body.dataset.open = "yes";
}

open().catch((error) => say(error.message));
