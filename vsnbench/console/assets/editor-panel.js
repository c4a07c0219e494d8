// The panel beside the plan: the fields of what is chosen, the checks' findings, and a list of everything.

import { LISTS, boxed, distance, rounded, titled, turned } from "./editor-model.js";

const FIELDS = {
  rooms: [["name", "text"], ["floor", ["wood", "tiles", "carpet", "concrete"]]],
  walls: [["thickness_m", "number", 0.1], ["height_m", "number"]],
  doors: [["name", "text"], ["height_m", "number", 2.0], ["closed", "flag"]],
  windows: [["sill_m", "number", 0.9], ["head_m", "number", 2.1]],
  objects: [["id", "text"], ["category", "category"], ["model", "model"], ["elevation_m", "number", 0]],
  starts: [["number", "number"], ["heading_deg", "number", 0], ["note", "text"], ["not_for", "goals"]],
};

function make(kind, fields, parent) {
  const element = Object.assign(document.createElement(kind), fields);
  parent?.append(element);
  return element;
}

const counted = (number, what) => `${number} ${what}${number === 1 ? "" : "s"}`;

/* A field's name as a person reads it: `survey error, m`. */
const labelled = (name) => name.replace(/_m$/, ", m").replace(/_deg$/, ", °").replaceAll("_", " ");

export class Panel {
  constructor(model, plan, state) {
    Object.assign(this, { model, plan, state });
    this.form = document.getElementById("chosen");
    this.form.addEventListener("submit", (event) => event.preventDefault());
  }

  showAll() {
    const list = document.getElementById("all");
    list.replaceChildren();
    for (const name of LISTS) {
      this.model.site[name].forEach((entry, index) => {
        const { chosen } = this.model;
        const button = make("button", { type: "button", textContent: titled(name, entry, index) }, make("li", {}, list));
        button.setAttribute("aria-pressed", String(Boolean(chosen && chosen[0] === name && chosen[1] === index)));
        button.addEventListener("click", () => { this.model.choose([name, index]); });
      });
    }
  }

  showChosen() {
    const { form, model } = this;
    const entry = model.entry();
    const focused = form.contains(document.activeElement) ? document.activeElement.id : null;
    form.replaceChildren();
    document.getElementById("chosen-title").textContent = entry ? `Chosen: ${titled(model.chosen[0], entry, model.chosen[1])}` : "The site";
    if (!entry) {
      this.#input("name", "text", model.site.name ?? "", (value) => { model.site.name = value; });
      this.#input("ceiling_height_m", "number", model.site.ceiling_height_m ?? 2.5, (value) => { model.site.ceiling_height_m = value; });
      this.#input("survey_error_m", "number", model.site.survey_error_m ?? 0.01, (value) => { model.site.survey_error_m = value; });
      make("p", { className: "dim small wide", textContent: "Survey error: how far off a wall may be measured, one standard deviation; objects twice that. A robot's placing is judged by it." }, form);
      if (focused) document.getElementById(focused)?.focus();
      return;
    }
    for (const [name, kind, usual] of FIELDS[model.chosen[0]]) this.#field(entry, name, kind, usual);
    if (entry.start) this.#stretch(entry);
    if (entry.position) {
      this.#point(entry, "position");
      if (entry.size_m) {
        this.#input("heading_deg", "number", entry.heading_deg ?? 0, (value) => turned(entry, value - (entry.heading_deg ?? 0)));
        ["depth", "width", "height"].forEach((word, index) => this.#input(`${word}, m`, "number", entry.size_m[index], (value) => { entry.size_m[index] = value; }));
        this.#button(entry.footprint ? "Back to a box" : "Outline it as a polygon", () => {
          if (entry.footprint) delete entry.footprint;
          else entry.footprint = this.plan.outlineOf(entry);
        });
      }
    }
    if (entry.polygon || entry.footprint) this.#corners(entry, entry.polygon ? "polygon" : "footprint");
    this.#button("Delete it", null, () => model.remove());
    if (focused) document.getElementById(focused)?.focus();
  }

  #field(entry, name, kind, usual) {
    const set = (value) => {
      if (value === "" || value === undefined || (usual !== undefined && value === usual && !(name in entry))) delete entry[name];
      else entry[name] = value;
    };
    if (Array.isArray(kind)) this.#choice(name, kind, entry[name] ?? kind[0], set);
    else if (kind === "category") this.#choice(name, this.state.categories, entry[name], (value) => { entry.category = value; delete entry.model; });
    else if (kind === "model") this.#choice(name, ["", ...(this.state.models[entry.category] ?? [])], entry[name] ?? "", set);
    else if (kind === "flag") this.#choice(name, ["no", "yes"], entry[name] ? "yes" : "no", (value) => set(value === "yes" ? true : ""));
    else if (kind === "goals") this.#input("not_for", "text", (entry.not_for ?? []).join(", "), (value) => {
      const goals = value.split(",").map((each) => each.trim()).filter(Boolean);
      set(goals.length ? goals : "");
    });
    else this.#input(name, kind, entry[name] ?? usual ?? "", set);
  }

  #stretch(entry) {
    this.#point(entry, "start");
    this.#point(entry, "end");
    this.#input("length, m", "number", rounded(distance(entry.start, entry.end)), (value) => {
      const share = value / (distance(entry.start, entry.end) || 1);
      entry.end = entry.start.map((from, axis) => rounded(from + (entry.end[axis] - from) * share));
    });
  }

  #point(entry, field) {
    ["x", "y"].forEach((axis, index) => this.#input(`${field === "position" ? "" : `${field} `}${axis}, m`, "number", rounded(entry[field][index]), (value) => { entry[field][index] = value; }));
  }

  #corners(entry, field) {
    entry[field].forEach((corner, number) => ["x", "y"].forEach((axis, index) => this.#input(`corner ${number + 1} ${axis}`, "number", rounded(corner[index]), (value) => { corner[index] = value; boxed(entry); })));
    this.#button("Add a corner", () => {
      const [first, last] = [entry[field][0], entry[field].at(-1)];
      entry[field].push([rounded((first[0] + last[0]) / 2), rounded((first[1] + last[1]) / 2)]);
    });
    if (entry[field].length > 3) entry[field].forEach((_, number) => this.#button(`Remove corner ${number + 1}`, () => { entry[field].splice(number, 1); boxed(entry); }));
  }

  #input(name, kind, value, set) {
    const id = `field-${name.replaceAll(/[^a-z0-9_]+/g, "-")}`;
    const holder = make("div", { className: kind === "text" ? "wide" : "" }, this.form);
    make("label", { htmlFor: id, textContent: labelled(name) }, holder);
    const input = make("input", { id, className: "field", value, type: "text" }, holder);
    if (kind === "number") input.inputMode = "decimal";
    input.addEventListener("change", () => {
      const said = kind === "number" && input.value.trim() !== "" ? Number(input.value.replace(",", ".")) : input.value.trim();
      if (Number.isNaN(said)) { input.setCustomValidity("a number"); input.reportValidity(); return; }
      this.model.change(() => set(said));
    });
  }

  #choice(name, options, value, set) {
    const id = `field-${name}`;
    const holder = make("div", {}, this.form);
    make("label", { htmlFor: id, textContent: labelled(name) }, holder);
    const select = make("select", { id, className: "field" }, holder);
    for (const option of options) make("option", { value: option, textContent: option || "usual" }, select);
    select.value = value;
    select.addEventListener("change", () => this.model.change(() => set(select.value)));
  }

  #button(words, alter, act = null) {
    const button = make("button", { type: "button", className: "key wide", textContent: words }, this.form);
    button.addEventListener("click", act ?? (() => this.model.change(alter)));
  }

  showFindings(findings) {
    const list = document.getElementById("findings");
    const errors = findings.filter((finding) => finding.severity === "error").length;
    document.getElementById("counted").textContent = findings.length ? `${counted(errors, "error")}, ${counted(findings.length - errors, "warning")} for ${this.state.robot.name}` : `nothing to complain about for ${this.state.robot.name}`;
    list.replaceChildren();
    for (const finding of findings) {
      const button = make("button", { type: "button", className: finding.severity, textContent: `${finding.severity}: ${finding.message}` }, make("li", {}, list));
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => {
        for (const other of list.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === button));
        const [entry] = finding.entries;
        if (entry && this.model.entry(entry)) this.model.choose([...entry]);
        this.plan.lit = finding.place;
        this.plan.draw();
      });
      for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => { this.plan.lit = finding.place; this.plan.draw(); });
    }
  }
}
