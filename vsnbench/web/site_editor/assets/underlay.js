// The card of the underlay: uploads it, scales and rotates it by two points, and sets its place.

import { distance, nearestOn, radians, rounded } from "./model.js";

const at = (id) => document.getElementById(id);
const number = (id) => {
  const text = at(id).value.trim().replace(",", ".");
  return text === "" ? null : Number(text);
};
const NUMBERS = ["x_m", "y_m", "turned_deg", "width_m"];

export class UnderlayCard {
  constructor(model, plan, showHint, post) {
    Object.assign(this, { model, plan, showHint, post, points: [], onChange: () => {} });
    at("files").addEventListener("change", (event) => this.#upload(event));
    at("measure").addEventListener("click", () => this.#measure());
    at("measured").addEventListener("submit", (event) => { event.preventDefault(); this.#set(); });
    at("measured-cancel").addEventListener("click", () => this.#cancel());
    at("origin").addEventListener("click", () => this.#origin());
    at("placed").addEventListener("submit", (event) => event.preventDefault());
    for (const name of NUMBERS) at(`underlay-${name}`).addEventListener("change", () => this.#setNumber(name));
    at("accept-lines").addEventListener("click", () => this.accept(plan.lines.splice(0)));
    at("reject-lines").addEventListener("click", () => { plan.lines = []; this.#changed(); });
    at("toggle-reject").addEventListener("click", (event) => this.#setPressed(event.target, !this.isRejecting));
    at("hide-underlay").addEventListener("click", (event) => {
      plan.underlay.hidden = !plan.underlay.hidden;
      event.target.setAttribute("aria-pressed", String(plan.underlay.hidden));
      plan.draw();
    });
    at("remove-underlay").addEventListener("click", () => this.#remove());
    plan.onLine = (index, reject) => {
      const [line] = plan.lines.splice(index, 1);
      if (reject || this.isRejecting) this.#changed();
      else this.accept([line]);
    };
  }

  get isRejecting() { return at("toggle-reject").getAttribute("aria-pressed") === "true"; }

  #setPressed(button, isPressed) { button.setAttribute("aria-pressed", String(isPressed)); }

  // The place that is saved with the site, or null without an underlay.
  content() {
    const { underlay, lines } = this.plan;
    if (!underlay) return null;
    const { href, hidden, ...place } = underlay;
    return { ...place, lines };
  }

  show(underlay) {
    const { plan } = this;
    const { lines, ...place } = underlay;
    plan.underlay = { ...place, href: `/underlay.png?${Date.now()}`, hidden: false };
    plan.lines = lines;
    at("underlay-made").hidden = false;
    this.#setPressed(at("hide-underlay"), false);
    this.#showProperties();
    plan.fit();
  }

  #showProperties() {
    const { underlay, lines } = this.plan;
    const proposed = `${lines.length} wall${lines.length === 1 ? "" : "s"} proposed`;
    at("underlay-name").textContent = `${underlay.name}: ${proposed}${underlay.to_scale ? "" : "; not to scale yet"}`;
    at("underlay-lines").hidden = !lines.length;
    const values = { ...underlay, turned_deg: (underlay.heading_rad * 180) / Math.PI };
    for (const name of NUMBERS) at(`underlay-${name}`).value = rounded(values[name], name === "turned_deg" ? 0.01 : 0.001);
  }

  #changed() {
    this.#showProperties();
    this.plan.draw();
    this.onChange();
  }

  // Moves `from` to `to`, and scales and rotates underlay and proposals about it.
  #transform(from, to, scale, turn) {
    const { plan } = this;
    const [cos, sin] = [scale * Math.cos(turn), scale * Math.sin(turn)];
    const transformed = ([x, y]) => [to[0] + cos * (x - from[0]) - sin * (y - from[1]), to[1] + sin * (x - from[0]) + cos * (y - from[1])];
    const { underlay } = plan;
    [underlay.x_m, underlay.y_m] = transformed([underlay.x_m, underlay.y_m]);
    underlay.width_m *= scale;
    underlay.height_m *= scale;
    underlay.heading_rad = Math.atan2(Math.sin(underlay.heading_rad + turn), Math.cos(underlay.heading_rad + turn));
    const transform = (segment) => ({ start: transformed(segment.start), end: transformed(segment.end) });
    plan.lines = plan.lines.map((line) => ({ ...transform(line), thickness_m: line.thickness_m * scale, doorways: line.doorways.map(transform) }));
    this.#changed();
  }

  #pick(count, text, then) {
    const { plan } = this;
    this.showHint(text[0]);
    plan.points = [];
    plan.onPoint = (point) => {
      plan.points.push(point);
      plan.draw();
      if (plan.points.length < count) { this.showHint(text[plan.points.length]); return; }
      plan.onPoint = null;
      then(plan.points);
    };
    plan.onNoPoint = () => this.#cancel();
    plan.svg.scrollIntoView({ block: "nearest" });
  }

  #measure() {
    at("measured").hidden = true;
    this.#pick(2, ["Click the first of two points with a known distance.", "Click the second point. Points far apart give a more exact scale."], (points) => {
      this.points = [...points];
      at("measured").hidden = false;
      at("known-m").value = at("known-deg").value = "";
      at("known-m").focus();
      const [one, other] = points;
      const turn = (Math.atan2(other[1] - one[1], other[0] - one[0]) * 180) / Math.PI;
      at("known-deg").placeholder = `now: ${rounded(turn, 0.1)}`;
      this.showHint("Enter their distance in the card Underlay.");
    });
  }

  #set() {
    const [one, other] = this.points;
    const [known, direction] = [number("known-m"), number("known-deg")];
    const drawn = distance(one, other);
    if (!(drawn > 0)) { this.showHint("Both points are the same. Click two different points."); return; }
    if ((known !== null && !(known > 0)) || (known === null && direction === null)) { this.showHint("Enter the distance in metres, for example 4.25."); return; }
    if (direction !== null && !Number.isFinite(direction)) { this.showHint("Enter the direction in degrees, for example 0 or 90."); return; }
    const turn = direction === null ? 0 : radians(direction) - Math.atan2(other[1] - one[1], other[0] - one[0]);
    if (known !== null) this.plan.underlay.to_scale = true;
    this.#cancel();
    this.#transform(one, one, known === null ? 1 : known / drawn, turn);
    this.plan.fit();
    this.showHint(`${known === null ? "Rotated" : `Scaled to ${known} m between the two points`}. To correct it, measure again.`);
  }

  #cancel() {
    at("measured").hidden = true;
    this.points = [];
    this.plan.points = [];
    this.plan.onPoint = this.plan.onNoPoint = null;
    this.plan.draw();
  }

  #origin() {
    this.#pick(1, ["Click the point for the origin (0, 0), for example an inner corner."], ([origin]) => {
      this.#cancel();
      this.#transform(origin, [0, 0], 1, 0);
      this.plan.fit();
      this.showHint("The underlay has moved. Drawn elements have not.");
    });
  }

  #setNumber(name) {
    const { underlay } = this.plan;
    const value = number(`underlay-${name}`);
    const corner = [underlay.x_m, underlay.y_m];
    if (value === null || !Number.isFinite(value) || (name === "width_m" && value <= 0)) { this.#showProperties(); this.showHint("Enter a number."); return; }
    if (name === "turned_deg") this.#transform(corner, corner, 1, radians(value) - underlay.heading_rad);
    else if (name === "width_m") { underlay.to_scale = true; this.#transform(corner, corner, value / underlay.width_m, 0); }
    else this.#transform(corner, name === "x_m" ? [value, corner[1]] : [corner[0], value], 1, 0);
  }

  #remove() {
    this.plan.underlay = null;
    this.plan.lines = [];
    at("underlay-made").hidden = true;
    at("files").value = "";
    this.plan.draw();
    this.onChange();
  }

  accept(lines) {
    const { model } = this;
    model.change((site) => {
      for (const line of lines) {
        const [start, end] = [line.start, line.end].map((point) => point.map((each) => rounded(each, 0.01)));
        const straight = (axis) => Math.abs(start[axis] - end[axis]) < 0.005 * distance(start, end);
        for (const axis of [0, 1]) if (straight(axis)) end[axis] = start[axis] = rounded((start[axis] + end[axis]) / 2, 0.01);
        const thick = rounded(Math.min(Math.max(line.thickness_m, 0.05), 0.5), 0.01);
        site.walls.push({ start, end, ...(Math.abs(thick - 0.1) < 0.035 ? {} : { thickness_m: thick }) });
        for (const doorway of line.doorways) {
          const [from, to] = [doorway.start, doorway.end].map((point) => nearestOn(start, end, point).map((each) => rounded(each)));
          site.doors.push({ name: model.newName("doors", "door"), start: from, end: to });
        }
      }
    });
    this.#changed();
  }

  async #upload(event) {
    const files = [...event.target.files];
    const mapYaml = files.find((file) => /\.ya?ml$/.test(file.name));
    const image = files.find((file) => file !== mapYaml);
    if (!image) { this.showHint("Select the map's image together with its map.yaml."); return; }
    try {
      const bytes = new Uint8Array(await image.arrayBuffer());
      let text = "";
      for (let from = 0; from < bytes.length; from += 0x8000) text += String.fromCharCode(...bytes.subarray(from, from + 0x8000));
      const upload = { image: btoa(text), name: (mapYaml ?? image).name, ...(mapYaml ? { map: await mapYaml.text() } : {}) };
      this.show(await (await this.post("/underlay", upload)).json());
      this.onChange();
      this.showHint(this.plan.underlay.to_scale ? "The map is shown to scale." : "Set the scale of the image by two points, in the card Underlay.");
    } catch (error) { this.showHint(error.message); }
  }
}
