// The goals of the site: their list with what the checks find, and the fields of the selected goal.

import { distance, outline, radians, rounded, shapeOf, targetsOf } from "./model.js";
import { idOf, make } from "./panel.js";

const at = (id) => document.getElementById(id);
const MAX_IMAGE_BYTES = 5_000_000;
const CAMERA_AWAY_M = 1.2;
const WORDS = { text: "the words", instruction: "the route in words" };
const NEEDED = { category: "category", text: "text", image: "image", instruction: "text", point: "targets", route: "images", sequence: "goals" };
const LISTS = { route: "images", sequence: "goals" };
const MOST_PHOTOS = 50; // of 640 x 480: a route may have 16 million pixels

export const KINDS = Object.keys(NEEDED);
const listOf = (value) => (Array.isArray(value) ? value : []);
const startsOf = (goal) => listOf(goal.starts);
const lengthOf = (way) => way.slice(1).reduce((sum, point, k) => sum + distance(way[k], point), 0);

// Poses at both ends of a way and evenly between, at most `every_m` apart, in the direction of the way.
export function posesAlong(way, every_m) {
  const whole = lengthOf(way);
  const parts = Math.max(1, Math.ceil(whole / every_m - 1e-6));
  return Array.from({ length: parts + 1 }, (_, number) => {
    let left = (whole * number) / parts;
    let k = 0;
    while (k < way.length - 2 && left > distance(way[k], way[k + 1])) { left -= distance(way[k], way[k + 1]); k += 1; }
    const [from, to] = [way[k], way[k + 1]];
    const share = Math.min(1, left / (distance(from, to) || 1));
    const heading_deg = rounded((Math.atan2(to[1] - from[1], to[0] - from[0]) * 180) / Math.PI, 1);
    return { x_m: rounded(from[0] + share * (to[0] - from[0]), 0.01), y_m: rounded(from[1] + share * (to[1] - from[1]), 0.01), heading_deg };
  });
}

// The name of a target: an object's id, `every chair`, `region kitchen`, or `point 2`.
export function targetName(target, index) {
  if (typeof target === "string") return target;
  if (target.object !== undefined) return target.object;
  if (target.category !== undefined) return `every ${target.category}`;
  return `${target.region ? "region" : "point"} ${target.name ?? index + 1}`;
}

// Reads `1-3, 7` as [1, 2, 3, 7]; null if it is not a list of numbers and ranges.
export function numbersOf(text) {
  const found = new Set();
  for (const part of text.split(/[\s,;]+/).filter(Boolean)) {
    const [, from, to] = /^(\d{1,4})(?:-(\d{1,4}))?$/.exec(part) ?? [];
    if (from === undefined) return null;
    for (let number = Number(from); number <= Number(to ?? from); number += 1) found.add(number);
  }
  return [...found].sort((a, b) => a - b);
}

// Writes [1, 2, 3, 7] as `1-3, 7`.
export function rangesOf(numbers) {
  const runs = [];
  for (const number of [...numbers].sort((a, b) => a - b)) {
    if (runs.length && runs.at(-1)[1] === number - 1) runs.at(-1)[1] = number;
    else runs.push([number, number]);
  }
  return runs.map(([from, to]) => (from === to ? `${from}` : `${from}-${to}`)).join(", ");
}

export class GoalCard {
  constructor(model, plan, tools, panel, { showHint, post }) {
    Object.assign(this, { model, plan, tools, panel, showHint, post, findings: [] });
    for (const kind of KINDS) make("option", { value: kind, textContent: kind }, at("new-goal-kind"));
    at("new-goal-kind").value = "text";
    at("add-goal").addEventListener("click", () => this.#add(at("new-goal-kind").value));
    panel.goalFields = (goal) => this.#fields(goal);
    tools.onTarget = (of) => this.#toggle(of);
    tools.onTargetDrawn = (target) => this.#addTarget(target);
    tools.onCamera = (camera) => this.#aim(camera);
    tools.onWayDrawn = (way) => this.#photographWay(way);
    this.every_m = 1;
  }

  // Shows the list. Below each goal is what the checks find in it.
  show() {
    const { model } = this;
    at("goal-list").replaceChildren();
    for (const [index, goal] of model.site.goals.entries()) {
      const row = make("li", {}, at("goal-list"));
      const button = make("button", { type: "button" }, row);
      make("strong", { textContent: goal.id ?? "" }, button);
      const targets = targetsOf(goal).map(targetName).join(", ");
      const starts = startsOf(goal).length ? `, starts ${rangesOf(startsOf(goal))}` : "";
      button.append(` ${goal.kind}: ${this.#described(goal)}${targets ? ` → ${targets}` : ""}${starts}`);
      button.setAttribute("aria-pressed", String(this.#goalIndex() === index));
      button.addEventListener("click", () => model.select(["goals", index]));
      const found = this.findings.filter((finding) => finding.entries.some(([list, at]) => list === "goals" && at === index));
      for (const finding of found) make("p", { className: `found ${finding.severity}`, textContent: `${finding.severity}: ${finding.message}` }, row);
    }
    at("goal-count").textContent = model.site.goals.length ? "" : "No goals beyond the categories of the objects.";
  }

  #described(goal) {
    if (goal.kind === "point") return "";
    const content = goal[NEEDED[goal.kind]] ?? "";
    if (goal.kind === "route") return `${content.length} photograph${content.length === 1 ? "" : "s"}`;
    return [content].flat().map((each) => each?.id ?? each).join(", ");
  }

  #goalIndex() { return this.model.selected?.[0] === "goals" ? this.model.selected[1] : -1; }

  get goal() { return this.model.site.goals[this.#goalIndex()]; }

  #add(kind) {
    const { model } = this;
    const goal = { id: model.newGoalId(), kind };
    if (kind === "category") goal.category = model.site.objects[0]?.category ?? "chair";
    else if (kind !== "sequence") goal.targets = [];
    if (LISTS[kind]) goal[LISTS[kind]] = [];
    if (kind === "text" || kind === "instruction") goal.text = "";
    if (kind === "instruction") goal.starts = [];
    this.panel.focusNext = "field-id";
    model.add("goals", goal);
  }

  // The fields of the selected goal in the panel's form, or those of one of its points or regions.
  #fields(goal) {
    const { model, panel } = this;
    const index = this.#goalIndex();
    const set = (name) => (value) => {
      if (value === "" || value === null) delete goal[name];
      else goal[name] = value;
    };
    panel.input("id", "text", goal.id ?? "", set("id"));
    panel.choice("kind", KINDS, goal.kind, (kind) => this.#setKind(goal, kind));
    if (WORDS[goal.kind]) panel.area("text", WORDS[goal.kind], goal.text ?? "", (text) => { goal.text = text.split(/\s+/).filter(Boolean).join(" "); });
    if (goal.kind === "category") panel.input("category", "text", goal.category ?? "", set("category"));
    if (goal.kind === "image") this.#imageFields(goal, set("image"));
    if (goal.kind === "route") this.#routeFields(goal);
    if (goal.kind === "sequence") this.#legFields(goal);
    if (goal.kind !== "sequence") this.#targetFields(goal, index);
    panel.input("starts", "text", rangesOf(startsOf(goal)), (text) => {
      const starts = numbersOf(text);
      if (starts === null) { this.showHint("Starts are numbers and ranges, such as 1-3, 7."); return; }
      if (starts.length || goal.kind === "instruction") goal.starts = starts;
      else delete goal.starts;
    });
    panel.note(goal.kind === "instruction" ? "Starting positions from which the instruction holds." : "Starting positions of its trials. Empty: all of the site.");
  }

  #setKind(goal, kind) {
    goal.kind = kind;
    for (const field of ["category", "text", "image", "images", "goals"]) if (field !== NEEDED[kind]) delete goal[field];
    if (kind === "category") goal.category ??= "chair";
    else if (kind === "sequence") delete goal.targets;
    else goal.targets ??= [];
    if (LISTS[kind]) goal[LISTS[kind]] ??= [];
    if (kind === "instruction") goal.starts ??= [];
  }

  // The goals of a sequence in their order.
  #legFields(goal) {
    const { model, panel } = this;
    panel.note("Its goals, in the order in which they are given:");
    this.#ordered(goal, "goals");
    const others = model.site.goals.filter((each) => each !== goal && each.kind !== "sequence").map((each) => each.id);
    const categories = [...new Set(model.site.objects.map((object) => object.category))].sort();
    panel.pick("add goal", [["", "…"], ...[...others, ...categories].map((name) => [name, name])], (name) => {
      if (!name) return;
      panel.focusNext = "field-add-goal";
      model.change(() => { goal.goals = [...listOf(goal.goals), name]; });
    });
  }

  // The photographs of a route in their order, and what takes more.
  #routeFields(goal) {
    const { panel, tools } = this;
    panel.note("Its photographs, along the way:");
    this.#ordered(goal, "images");
    panel.input("add files", "text", "", (text) => { goal.images = [...listOf(goal.images), ...text.split(/[\s,;]+/).filter(Boolean)]; });
    panel.note("Names of images next to the site file, separated by commas.");
    this.#drawing("Draw a way and photograph it", "way");
    panel.quiet("a photo every, m", this.every_m, (metres) => { if (metres > 0) this.every_m = metres; });
    if (tools.tool === "way") panel.note("By keyboard: arrow keys move the plan, Enter adds a point in its middle, and Enter again ends the way there.");
    this.#cameraFields(goal, "Add a photo from the twin");
  }

  // The entries of a list of a goal, each with buttons that move it or remove it.
  #ordered(goal, field) {
    const { model, panel } = this;
    const list = make("ol", { className: "targets wide" }, panel.form);
    list.setAttribute("aria-label", field);
    const entries = listOf(goal[field]);
    entries.forEach((entry, place) => {
      const row = make("li", {}, list);
      const name = entry?.id ?? entry;
      make("span", { textContent: field === "images" ? `${place + 1}.` : `${place + 1}. ${name}` }, row);
      if (field === "images") make("img", { className: "photo", alt: name, title: name, src: `/goal-image?file=${encodeURIComponent(name)}` }, row);
      const key = (text, words, to) => {
        const button = make("button", { type: "button", id: idOf(`${field} ${place} ${words}`), className: "key", textContent: text, disabled: to !== null && !(to in entries) }, row);
        button.setAttribute("aria-label", `${place + 1}. ${name}: ${words}`);
        button.addEventListener("click", () => {
          const others = entries.filter((_, other) => other !== place);
          if (to !== null) others.splice(to, 0, entry);
          panel.focusNext = idOf(`${field} ${Math.min(to ?? place, others.length - 1)} ${words}`);
          model.change(() => { goal[field] = others; });
        });
      };
      key("↑", "earlier", place - 1);
      key("↓", "later", place + 1);
      key("Remove", "remove", null);
    });
    if (!entries.length) panel.note("None yet.");
  }

  #drawing(text, tool) {
    const { panel, plan, tools } = this;
    panel.press(text, (event) => {
      tools.use(tool);
      if (event.detail === 0) tools.addInView(); // selected by keyboard, so there is no pointer position
      plan.svg.focus({ preventScroll: true });
      plan.svg.scrollIntoView({ block: "nearest" });
    }, tools.tool === tool);
  }

  #targetFields(goal, index) {
    const { model, panel } = this;
    const list = make("ul", { className: "targets wide" }, panel.form);
    list.setAttribute("aria-label", "Targets");
    targetsOf(goal).forEach((target, number) => {
      const row = make("li", {}, list);
      const name = targetName(target, number);
      if (shapeOf(target)) {
        const open = make("button", { type: "button", id: idOf(`target ${number}`), className: "key", textContent: name }, row);
        open.addEventListener("click", () => model.select(["goals", index, number]));
      } else make("span", { textContent: name }, row);
      const remove = make("button", { type: "button", id: idOf(`remove target ${number}`), className: "key", textContent: "Remove" }, row);
      remove.setAttribute("aria-label", `Remove target ${name}`);
      remove.addEventListener("click", () => { panel.focusNext = "field-add-target"; model.change(() => { goal.targets = targetsOf(goal).filter((_, other) => other !== number); }); });
    });
    if (!targetsOf(goal).length) panel.note(goal.kind === "category" ? "Targets: every object of the category." : "No targets yet: choose what counts as reached.");
    if (goal.kind === "point") { this.#drawing("Place the point on the plan", "point"); return; }
    const categories = [...new Set(model.site.objects.map((object) => object.category))].sort();
    const options = [["", "…"], ...model.site.objects.map((object) => [object.id, object.id]), ...categories.map((category) => [`every ${category}`, `every ${category}`])];
    panel.pick("add target", options, (value) => {
      if (!value) return;
      this.#addTarget(value.startsWith("every ") ? { category: value.slice(6) } : value);
    });
    this.#drawing("Choose targets on the plan", "target");
    this.#drawing("Draw a region", "region");
    this.#drawing("Add a point", "point");
  }

  #addTarget(target) {
    const { goal, model } = this;
    if (!goal) return;
    const index = this.#goalIndex();
    const shape = shapeOf(target);
    if (!shape && targetsOf(goal).some((each, number) => targetName(each, number) === targetName(target))) return;
    model.change(() => { goal.targets = goal.kind === "point" ? [target] : [...targetsOf(goal), target]; });
    if (shape) model.select(["goals", index, goal.targets.length - 1]);
  }

  // A click on an object makes it a target, or no target; a click on a start does so with the goal's starts.
  #toggle(of) {
    const { goal, model } = this;
    if (!goal || !of) return;
    const entry = model.site[of[0]]?.[Number(of[1])];
    if (of[0] === "objects") {
      const before = targetsOf(goal);
      const others = before.filter((target) => (target.object ?? target) !== entry.id);
      model.change(() => { goal.targets = others.length < before.length ? others : [...before, entry.id]; });
    } else if (of[0] === "starts") {
      const before = startsOf(goal);
      const others = before.filter((number) => number !== entry.number);
      const starts = others.length < before.length ? others : [...before, entry.number].sort((a, b) => a - b);
      model.change(() => { if (starts.length || goal.kind === "instruction") goal.starts = starts; else delete goal.starts; });
    }
  }

  #imageFields(goal, set) {
    const { panel } = this;
    panel.input("image", "text", goal.image ?? "", set);
    if (goal.image) {
      const image = make("img", { className: "wide photo", alt: `Image of goal ${goal.id}`, src: `/goal-image?file=${encodeURIComponent(goal.image)}` }, panel.form);
      image.addEventListener("error", () => { image.hidden = true; });
    }
    this.#cameraFields(goal, "Take a photo from the twin");
  }

  // What uploads a photograph, and the camera that takes one in the twin.
  #cameraFields(goal, take) {
    const { panel, plan, tools } = this;
    const camera = this.camera(goal);
    const upload = panel.file("upload an image", "image/png,image/jpeg", (file) => this.#upload(goal, file));
    upload.setAttribute("aria-describedby", "hint");
    const set1 = (name) => (value) => { this.#aim({ [name]: value }); };
    panel.quiet("camera x, m", camera.x_m, set1("x_m"));
    panel.quiet("camera y, m", camera.y_m, set1("y_m"));
    panel.quiet("camera heading, °", camera.heading_deg, set1("heading_deg"));
    panel.press("Place the camera on the plan", () => {
      tools.use("camera");
      plan.svg.scrollIntoView({ block: "nearest" });
    }, tools.tool === "camera");
    panel.press(take, () => this.#store("/goal-photo", goal, { site: this.model.site, ...this.camera(goal) }));
  }

  // The pose of the camera: as placed, else in front of the first target, else at the first start.
  camera(goal) {
    if (this.pose && this.pose.id === goal.id) { const { id, ...pose } = this.pose; return pose; }
    const { objects, starts } = this.model.site;
    const wanted = targetsOf(goal)[0];
    const object = objects.find((each) => each.id === (wanted?.object ?? wanted) || (wanted?.category && each.category === wanted.category));
    if (object) {
      const turn = radians(object.heading_deg ?? 0);
      const away = Math.max(...outline(object).map(([x, y]) => Math.hypot(x - object.position[0], y - object.position[1]))) + CAMERA_AWAY_M;
      const heading = ((((object.heading_deg ?? 0) + 360) % 360) + 360) % 360 - 180;
      return { x_m: rounded(object.position[0] + Math.cos(turn) * away, 0.01), y_m: rounded(object.position[1] + Math.sin(turn) * away, 0.01), heading_deg: rounded(heading, 1) };
    }
    const [x, y] = starts[0]?.position ?? this.plan.centre();
    return { x_m: rounded(x, 0.01), y_m: rounded(y, 0.01), heading_deg: starts[0]?.heading_deg ?? 0 };
  }

  // Takes photographs in the twin at the ends of a way and evenly between, each in the direction of the way.
  async #photographWay(way) {
    const { goal, model } = this;
    const poses = posesAlong(way, this.every_m);
    if (!goal || listOf(goal.images).length + poses.length > MOST_PHOTOS) {
      this.showHint(`The way has ${poses.length} photographs; a route has at most ${MOST_PHOTOS}: take one less often.`);
      return;
    }
    const group = Symbol("way");
    for (const [number, pose] of poses.entries()) {
      this.showHint(`Photograph ${number + 1} of ${poses.length} …`);
      if (!(await this.#store("/goal-photo", goal, { site: model.site, ...pose }, group))) return;
    }
    const end = way.at(-1);
    const current = model.site.goals.find((each) => each.id === goal.id);
    if (current && !targetsOf(current).length) model.change(() => { current.targets = [{ point: end }]; }, group);
    this.showHint(`${poses.length} photographs along ${lengthOf(way).toFixed(1)} m.`);
  }

  // The camera to draw on the plan and to preview; null unless a goal with photographs is selected.
  shownCamera() { return ["image", "route"].includes(this.goal?.kind) && this.model.selected.length === 2 ? this.camera(this.goal) : null; }

  #aim(camera) {
    if (!this.goal) return;
    this.pose = { id: this.goal.id, ...this.camera(this.goal), ...camera };
    this.onCamera();
  }

  #upload(goal, file) {
    if (file.size > MAX_IMAGE_BYTES) { this.showHint(`${file.name} is larger than ${MAX_IMAGE_BYTES / 1e6} MB: scale it down.`); return; }
    const reader = new FileReader();
    reader.addEventListener("load", () => this.#store("/goal-image", goal, { image: String(reader.result).replace(/^.*?,/, "") }));
    reader.readAsDataURL(file);
  }

  // Stores a photograph and returns whether it became one of the goal; those of a `group` are undone together.
  async #store(path, goal, content, group = null) {
    const index = this.model.site.goals.findIndex((each) => each.id === goal.id);
    try {
      const { file } = await (await this.post(path, { goal: goal.id ?? "", ...content })).json();
      const current = this.model.site.goals[index];
      if (current?.id !== goal.id) return false;
      if (this.panel.form.contains(document.activeElement)) document.activeElement.blur(); // applies a value that was just typed
      this.model.change(() => { if (current.kind === "route") current.images = [...listOf(current.images), file]; else current.image = file; }, group);
      this.showHint(`Stored ${file}.`);
      return true;
    } catch (error) { this.showHint(error.message); return false; }
  }
}
