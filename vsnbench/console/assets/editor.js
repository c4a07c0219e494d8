// The site editor's page: opens the site, puts plan, tools and panel together, checks and saves.

import { Model, SIZES, distance, nearestOn, outline, rounded } from "./editor-model.js";
import { Panel } from "./editor-panel.js";
import { Plan } from "./editor-plan.js";
import { TOOLS, Tools } from "./editor-tools.js";

const by = (id) => document.getElementById(id);
const say = (words) => { by("hint").textContent = words; };
let state;
let model;
let plan;
let panel;
let tools;
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

function changed() {
  isDirty = true;
  by("saved").textContent = `${state.path}: not saved`;
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
    const answer = await (await post("/save", { site: model.site })).json();
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

function layUnder(underlay) {
  plan.underlay = { ...underlay, href: `/underlay.png?${Date.now()}`, hidden: false };
  plan.lines = underlay.lines;
  by("underlay-made").hidden = false;
  by("underlay-name").textContent = `${underlay.name}: ${underlay.lines.length} walls proposed${underlay.to_scale ? "" : "; not to scale yet"}. A click takes a proposal, Shift and click drops it.`;
  plan.fit();
}

function takeLines(lines) {
  model.change((site) => {
    for (const line of lines) {
      const [start, end] = [line.start, line.end].map((point) => point.map((each) => rounded(each, 0.01)));
      const straight = (axis) => Math.abs(start[axis] - end[axis]) < 0.02 * distance(start, end);
      for (const axis of [0, 1]) if (straight(axis)) end[axis] = start[axis] = rounded((start[axis] + end[axis]) / 2, 0.01);
      const thick = rounded(Math.min(Math.max(line.thickness_m, 0.05), 0.5), 0.01);
      site.walls.push({ start, end, ...(Math.abs(thick - 0.1) < 0.035 ? {} : { thickness_m: thick }) });
      for (const doorway of line.doorways) {
        const [from, to] = [doorway.start, doorway.end].map((point) => nearestOn(start, end, point).map((each) => rounded(each)));
        site.doors.push({ name: model.freshName("doors", "door"), start: from, end: to });
      }
    }
  });
}

async function filesTaken(event) {
  const files = [...event.target.files];
  const described = files.find((file) => /\.ya?ml$/.test(file.name));
  const image = files.find((file) => file !== described);
  if (!image) { say("Choose the map's image together with its map.yaml."); return; }
  try {
    const bytes = new Uint8Array(await image.arrayBuffer());
    let text = "";
    for (let from = 0; from < bytes.length; from += 0x8000) text += String.fromCharCode(...bytes.subarray(from, from + 0x8000));
    const said = { image: btoa(text), name: (described ?? image).name, ...(described ? { map: await described.text() } : {}) };
    layUnder(await (await post("/underlay", said)).json());
  } catch (error) { say(error.message); }
}

function setScale() {
  say("Click one of two points whose distance you know, then the other.");
  plan.scalePoints = [];
  plan.onPoint = (at) => {
    plan.scalePoints.push(at);
    plan.draw();
    if (plan.scalePoints.length < 2) return;
    plan.onPoint = null;
    const [one, other] = plan.scalePoints;
    plan.scalePoints = [];
    const known = Number((window.prompt("How far are they apart, in metres?") ?? "").replace(",", "."));
    if (!(known > 0) || distance(one, other) === 0) { say("No distance: the scale stays."); return; }
    const times = known / distance(one, other);
    const { underlay } = plan;
    for (const field of ["x_m", "y_m", "width_m", "height_m"]) underlay[field] *= times;
    const scaled = (each) => ({ start: each.start.map((at) => at * times), end: each.end.map((at) => at * times) });
    plan.lines = plan.lines.map((line) => ({ ...scaled(line), thickness_m: line.thickness_m * times, doorways: line.doorways.map(scaled) }));
    plan.fit();
    say(`Scaled: ${known} m between the two points.`);
  };
}

function wire() {
  model.addEventListener("change", changed);
  model.addEventListener("choice", () => { shown(); look(); });
  plan.onSettled = look;
  plan.outlineOf = (entry) => outline(entry).map((point) => point.map((each) => rounded(each)));
  plan.onLine = (index, drop) => {
    const [line] = plan.lines.splice(index, 1);
    if (drop) plan.draw();
    else takeLines([line]);
  };
  by("undo").addEventListener("click", () => model.undo());
  by("redo").addEventListener("click", () => model.redo());
  by("zoom-in").addEventListener("click", () => plan.zoom(0.8));
  by("zoom-out").addEventListener("click", () => plan.zoom(1.25));
  by("fit").addEventListener("click", () => plan.fit());
  by("save").addEventListener("click", save);
  by("files").addEventListener("change", filesTaken);
  by("scale").addEventListener("click", setScale);
  by("accept-lines").addEventListener("click", () => takeLines(plan.lines.splice(0)));
  by("reject-lines").addEventListener("click", () => { plan.lines = []; plan.draw(); });
  by("hide-underlay").addEventListener("click", (event) => {
    plan.underlay.hidden = !plan.underlay.hidden;
    event.target.setAttribute("aria-pressed", String(plan.underlay.hidden));
    plan.draw();
  });
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
  by("title").textContent = `Site ${state.site.name}`;
  by("saved").textContent = state.path;
  toolbar();
  wire();
  if (state.underlay) layUnder(state.underlay);
  plan.fit();
  shown();
  check();
  tools.use("choose");
  document.body.dataset.open = "yes";
}

open().catch((error) => say(error.message));
