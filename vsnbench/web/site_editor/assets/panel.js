// The side panel: fields of the selected element, findings of the checks, and a list of all elements.

import { LISTS, distance, fitBox, rounded, titleOf, rotate } from "./model.js";

const FIELDS = {
  rooms: [["name", "text"], ["floor", ["wood", "tiles", "carpet", "concrete"]]],
  walls: [["thickness_m", "number", 0.1], ["height_m", "number"]],
  doors: [["name", "text"], ["height_m", "number", 2.0], ["closed", "flag"]],
  windows: [["sill_m", "number", 0.9], ["head_m", "number", 2.1]],
  objects: [["id", "text"], ["category", "category"], ["model", "model"], ["elevation_m", "number", 0]],
  starts: [["number", "number"], ["heading_deg", "number", 0], ["note", "text"], ["not_for", "goals"]],
};

export function make(kind, fields, parent) {
  const element = Object.assign(document.createElement(kind), fields);
  parent?.append(element);
  return element;
}

// The id of a field or button of the form, which keeps the focus when the form is drawn again.
export const idOf = (name) => `field-${name.toLowerCase().replaceAll(/[^a-z0-9_]+/g, "-")}`;

const counted = (number, what) => `${number} ${what}${number === 1 ? "" : "s"}`;

// The label of a field: `survey error, m` for survey_error_m.
const labelOf = (name) => name.replace(/_m$/, ", m").replace(/_deg$/, ", °").replaceAll("_", " ");

export class Panel {
  constructor(model, plan, state) {
    Object.assign(this, { model, plan, state });
    this.form = document.getElementById("selection");
    this.form.addEventListener("submit", (event) => event.preventDefault());
  }

  showAll() {
    const list = document.getElementById("all");
    list.replaceChildren();
    for (const name of LISTS) {
      this.model.site[name].forEach((entry, index) => {
        const { selected } = this.model;
        const button = make("button", { type: "button", textContent: titleOf(name, entry, index) }, make("li", {}, list));
        button.setAttribute("aria-pressed", String(Boolean(selected && selected[0] === name && selected[1] === index)));
        button.addEventListener("click", () => { this.model.select([name, index]); });
      });
    }
  }

  showSelection() {
    const { form, model } = this;
    const entry = model.entry();
    const focused = this.focusNext ?? (form.contains(document.activeElement) ? document.activeElement.id : null);
    this.focusNext = null;
    form.replaceChildren();
    document.getElementById("selection-title").textContent = entry ? `Selected: ${titleOf(model.selected[0], entry, model.selected[1])}` : "The site";
    if (!entry) {
      this.input("name", "text", model.site.name ?? "", (value) => { model.site.name = value; });
      this.input("ceiling_height_m", "number", model.site.ceiling_height_m ?? 2.5, (value) => { model.site.ceiling_height_m = value; });
      this.input("survey_error_m", "number", model.site.survey_error_m ?? 0.01, (value) => { model.site.survey_error_m = value; });
      make("p", { className: "dim small wide", textContent: "Survey error: standard deviation of measured wall positions; objects have twice that. The placement check of the robot uses it." }, form);
      if (focused) document.getElementById(focused)?.focus();
      return;
    }
    if (model.selected[0] === "goals") this.#goal(entry);
    for (const [name, kind, standard] of FIELDS[model.selected[0]] ?? []) this.#field(entry, name, kind, standard);
    if (entry.start) this.#segment(entry);
    if (entry.point) this.#point(entry, "point");
    if (entry.position) {
      this.#point(entry, "position");
      if (entry.size_m) {
        this.input("heading_deg", "number", entry.heading_deg ?? 0, (value) => rotate(entry, value - (entry.heading_deg ?? 0)));
        ["depth", "width", "height"].forEach((word, index) => this.input(`${word}, m`, "number", entry.size_m[index], (value) => { entry.size_m[index] = value; }));
        this.press(entry.footprint ? "Use a box" : "Use a polygon outline", () => model.change(() => {
          if (entry.footprint) delete entry.footprint;
          else entry.footprint = this.plan.outlineOf(entry);
        }));
      }
    }
    const outlined = ["polygon", "footprint", "region"].find((field) => entry[field]);
    if (outlined) this.#corners(entry, outlined);
    this.press("Delete", () => model.remove());
    if (focused) document.getElementById(focused)?.focus();
  }

  // The fields of a goal, or of one of its points and regions.
  #goal(entry) {
    const [list, index, target] = this.model.selected;
    if (target === undefined) { this.goalFields(entry); return; }
    this.press(`Back to goal ${this.model.site.goals[index].id}`, () => this.model.select([list, index]));
    this.input("name", "text", entry.name ?? "", (value) => { if (value) entry.name = value; else delete entry.name; });
  }

  #field(entry, name, kind, standard) {
    const set = (value) => {
      const { selected } = this.model;
      if ((name === "id" || name === "number") && value !== "") this.model.rename(selected[0], entry[name], value);
      if (value === "" || value === undefined || (standard !== undefined && value === standard && !(name in entry))) delete entry[name];
      else entry[name] = value;
    };
    if (Array.isArray(kind)) this.choice(name, kind, entry[name] ?? kind[0], set);
    else if (kind === "category") this.choice(name, this.state.categories, entry[name], (value) => { entry.category = value; delete entry.model; });
    else if (kind === "model") this.choice(name, ["", ...(this.state.models[entry.category] ?? [])], entry[name] ?? "", set);
    else if (kind === "flag") this.choice(name, ["no", "yes"], entry[name] ? "yes" : "no", (value) => set(value === "yes" ? true : ""));
    else if (kind === "goals") this.input("not_for", "text", (entry.not_for ?? []).join(", "), (value) => {
      const goals = value.split(",").map((each) => each.trim()).filter(Boolean);
      set(goals.length ? goals : "");
    });
    else this.input(name, kind, entry[name] ?? standard ?? "", set);
  }

  #segment(entry) {
    this.#point(entry, "start");
    this.#point(entry, "end");
    this.input("length, m", "number", rounded(distance(entry.start, entry.end)), (value) => {
      const share = value / (distance(entry.start, entry.end) || 1);
      entry.end = entry.start.map((from, axis) => rounded(from + (entry.end[axis] - from) * share));
    });
  }

  #point(entry, field) {
    ["x", "y"].forEach((axis, index) => this.input(`${field === "position" || field === "point" ? "" : `${field} `}${axis}, m`, "number", rounded(entry[field][index]), (value) => { entry[field][index] = value; }));
  }

  #corners(entry, field) {
    entry[field].forEach((corner, number) => ["x", "y"].forEach((axis, index) => this.input(`corner ${number + 1} ${axis}`, "number", rounded(corner[index]), (value) => { corner[index] = value; fitBox(entry); })));
    this.press("Add a corner", () => this.model.change(() => {
      const [first, last] = [entry[field][0], entry[field].at(-1)];
      entry[field].push([rounded((first[0] + last[0]) / 2), rounded((first[1] + last[1]) / 2)]);
    }));
    if (entry[field].length > 3) entry[field].forEach((_, number) => this.press(`Remove corner ${number + 1}`, () => this.model.change(() => { entry[field].splice(number, 1); fitBox(entry); })));
  }

  // A labelled element of the form.
  #labelled(kind, name, fields, isWide) {
    const id = idOf(name);
    const holder = make("div", { className: isWide ? "wide" : "" }, this.form);
    make("label", { htmlFor: id, textContent: labelOf(name) }, holder);
    return make(kind, { id, className: "field", ...fields }, holder);
  }

  input(name, kind, value, set) {
    const input = this.#labelled("input", name, { value, type: "text" }, kind === "text");
    if (kind === "number") input.inputMode = "decimal";
    input.addEventListener("change", () => {
      const value = kind === "number" && input.value.trim() !== "" ? Number(input.value.replace(",", ".")) : input.value.trim();
      if (Number.isNaN(value)) { input.setCustomValidity("Enter a number."); input.reportValidity(); return; }
      input.setCustomValidity("");
      this.model.change(() => set(value));
    });
  }

  // A number that is not part of the site.
  quiet(name, value, set) {
    const input = this.#labelled("input", name, { value, type: "text", inputMode: "decimal" }, false);
    input.addEventListener("change", () => {
      const number = Number(input.value.trim().replace(",", "."));
      if (input.value.trim() !== "" && Number.isFinite(number)) set(number);
    });
  }

  area(name, label, value, set) {
    const area = this.#labelled("textarea", name, { value, rows: 3, maxLength: 2000 }, true);
    area.placeholder = label;
    area.addEventListener("change", () => this.model.change(() => set(area.value)));
  }

  file(name, accept, act) {
    const input = this.#labelled("input", name, { type: "file", accept }, true);
    input.addEventListener("change", () => { if (input.files[0]) act(input.files[0]); });
    return input;
  }

  // A choice that acts at once and is not part of the site. `options` are pairs of value and text.
  pick(name, options, act) {
    const select = this.#labelled("select", name, {}, true);
    for (const [value, textContent] of options) make("option", { value, textContent }, select);
    select.addEventListener("change", () => act(select.value));
  }

  note(text) { make("p", { className: "dim small wide", textContent: text }, this.form); }

  choice(name, options, value, set) {
    const select = this.#labelled("select", name, {}, false);
    for (const option of options) make("option", { value: option, textContent: option || "default" }, select);
    select.value = value;
    select.addEventListener("change", () => this.model.change(() => set(select.value)));
  }

  press(text, act, isPressed = null) {
    const button = make("button", { type: "button", id: idOf(text), className: "key wide", textContent: text }, this.form);
    if (isPressed !== null) button.setAttribute("aria-pressed", String(isPressed));
    button.addEventListener("click", act);
  }

  showFindings(findings) {
    const list = document.getElementById("findings");
    const errors = findings.filter((finding) => finding.severity === "error").length;
    document.getElementById("finding-count").textContent = findings.length ? `${counted(errors, "error")}, ${counted(findings.length - errors, "warning")} for ${this.state.robot.name}` : `No findings for ${this.state.robot.name}`;
    list.replaceChildren();
    for (const finding of findings) {
      const button = make("button", { type: "button", className: finding.severity, textContent: `${finding.severity}: ${finding.message}` }, make("li", {}, list));
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => {
        for (const other of list.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === button));
        const [entry] = finding.entries;
        if (entry && this.model.entry(entry)) this.model.select([...entry]);
        this.plan.highlight = finding.place;
        this.plan.draw();
      });
      for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => { this.plan.highlight = finding.place; this.plan.draw(); });
    }
  }
}
