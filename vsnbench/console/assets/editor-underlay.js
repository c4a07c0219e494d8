// The card of what lies under the plan: taken from files, scaled and turned by two points, placed by numbers.

import { distance, nearestOn, radians, rounded } from "./editor-model.js";

const by = (id) => document.getElementById(id);
const number = (id) => {
  const said = by(id).value.trim().replace(",", ".");
  return said === "" ? null : Number(said);
};
const NUMBERS = ["x_m", "y_m", "turned_deg", "width_m"];

export class UnderlayCard {
  constructor(model, plan, say, post) {
    Object.assign(this, { model, plan, say, post, points: [], onAltered: () => {} });
    by("files").addEventListener("change", (event) => this.#taken(event));
    by("measure").addEventListener("click", () => this.#measure());
    by("measured").addEventListener("submit", (event) => { event.preventDefault(); this.#set(); });
    by("measured-cancel").addEventListener("click", () => this.#cancel());
    by("origin").addEventListener("click", () => this.#origin());
    by("placed").addEventListener("submit", (event) => event.preventDefault());
    for (const name of NUMBERS) by(`underlay-${name}`).addEventListener("change", () => this.#typed(name));
    by("accept-lines").addEventListener("click", () => this.take(plan.lines.splice(0)));
    by("reject-lines").addEventListener("click", () => { plan.lines = []; this.#altered(); });
    by("drop-lines").addEventListener("click", (event) => this.#press(event.target, !this.drops));
    by("hide-underlay").addEventListener("click", (event) => {
      plan.underlay.hidden = !plan.underlay.hidden;
      event.target.setAttribute("aria-pressed", String(plan.underlay.hidden));
      plan.draw();
    });
    by("remove-underlay").addEventListener("click", () => this.#remove());
    plan.onLine = (index, drop) => {
      const [line] = plan.lines.splice(index, 1);
      if (drop || this.drops) this.#altered();
      else this.take([line]);
    };
  }

  get drops() { return by("drop-lines").getAttribute("aria-pressed") === "true"; }

  #press(button, isPressed) { button.setAttribute("aria-pressed", String(isPressed)); }

  // What is saved with the site; null where nothing lies under it.
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
    by("underlay-made").hidden = false;
    this.#press(by("hide-underlay"), false);
    this.#told();
    plan.fit();
  }

  #told() {
    const { underlay, lines } = this.plan;
    const proposed = `${lines.length} wall${lines.length === 1 ? "" : "s"} proposed`;
    by("underlay-name").textContent = `${underlay.name}: ${proposed}${underlay.to_scale ? "" : "; not to scale yet"}`;
    by("underlay-lines").hidden = !lines.length;
    const values = { ...underlay, turned_deg: (underlay.heading_rad * 180) / Math.PI };
    for (const name of NUMBERS) by(`underlay-${name}`).value = rounded(values[name], name === "turned_deg" ? 0.01 : 0.001);
  }

  #altered() {
    this.#told();
    this.plan.draw();
    this.onAltered();
  }

  // Moves `from` to `to`, and turns and stretches everything about it.
  #transform(from, to, times, turn) {
    const { plan } = this;
    const [cos, sin] = [times * Math.cos(turn), times * Math.sin(turn)];
    const carried = ([x, y]) => [to[0] + cos * (x - from[0]) - sin * (y - from[1]), to[1] + sin * (x - from[0]) + cos * (y - from[1])];
    const { underlay } = plan;
    [underlay.x_m, underlay.y_m] = carried([underlay.x_m, underlay.y_m]);
    underlay.width_m *= times;
    underlay.height_m *= times;
    underlay.heading_rad = Math.atan2(Math.sin(underlay.heading_rad + turn), Math.cos(underlay.heading_rad + turn));
    const stretch = (each) => ({ start: carried(each.start), end: carried(each.end) });
    plan.lines = plan.lines.map((line) => ({ ...stretch(line), thickness_m: line.thickness_m * times, doorways: line.doorways.map(stretch) }));
    this.#altered();
  }

  #pick(count, words, then) {
    const { plan } = this;
    this.say(words[0]);
    plan.points = [];
    plan.onPoint = (at) => {
      plan.points.push(at);
      plan.draw();
      if (plan.points.length < count) { this.say(words[plan.points.length]); return; }
      plan.onPoint = null;
      then(plan.points);
    };
    plan.onNoPoint = () => this.#cancel();
    plan.svg.scrollIntoView({ block: "nearest" });
  }

  #measure() {
    by("measured").hidden = true;
    this.#pick(2, ["Click one of two points whose distance you know.", "Now the other one; farther apart is more exact."], (points) => {
      this.points = [...points];
      by("measured").hidden = false;
      by("known-m").value = by("known-deg").value = "";
      by("known-m").focus();
      const [one, other] = points;
      const turn = (Math.atan2(other[1] - one[1], other[0] - one[0]) * 180) / Math.PI;
      by("known-deg").placeholder = `as it lies: ${rounded(turn, 0.1)}`;
      this.say("Type how far they are apart, in the card Underlay.");
    });
  }

  #set() {
    const [one, other] = this.points;
    const [known, direction] = [number("known-m"), number("known-deg")];
    const drawn = distance(one, other);
    if (!(drawn > 0)) { this.say("The two points are one: choose them again."); return; }
    if ((known !== null && !(known > 0)) || (known === null && direction === null)) { this.say("Type the distance in metres, for instance 4.25."); return; }
    if (direction !== null && !Number.isFinite(direction)) { this.say("Type the direction in degrees, for instance 0 or 90."); return; }
    const turn = direction === null ? 0 : radians(direction) - Math.atan2(other[1] - one[1], other[0] - one[0]);
    if (known !== null) this.plan.underlay.to_scale = true;
    this.#cancel();
    this.#transform(one, one, known === null ? 1 : known / drawn, turn);
    this.plan.fit();
    this.say(`${known === null ? "Turned" : `Scaled: ${known} m between the two points`}. Not right? Measure again.`);
  }

  #cancel() {
    by("measured").hidden = true;
    this.points = [];
    this.plan.points = [];
    this.plan.onPoint = this.plan.onNoPoint = null;
    this.plan.draw();
  }

  #origin() {
    this.#pick(1, ["Click the point that is to be (0, 0): an inner corner."], ([at]) => {
      this.#cancel();
      this.#transform(at, [0, 0], 1, 0);
      this.plan.fit();
      this.say("The underlay was moved; what is drawn stays where it is.");
    });
  }

  #typed(name) {
    const { underlay } = this.plan;
    const said = number(`underlay-${name}`);
    const corner = [underlay.x_m, underlay.y_m];
    if (said === null || !Number.isFinite(said) || (name === "width_m" && said <= 0)) { this.#told(); this.say("A number is needed here."); return; }
    if (name === "turned_deg") this.#transform(corner, corner, 1, radians(said) - underlay.heading_rad);
    else if (name === "width_m") { underlay.to_scale = true; this.#transform(corner, corner, said / underlay.width_m, 0); }
    else this.#transform(corner, name === "x_m" ? [said, corner[1]] : [corner[0], said], 1, 0);
  }

  #remove() {
    this.plan.underlay = null;
    this.plan.lines = [];
    by("underlay-made").hidden = true;
    by("files").value = "";
    this.plan.draw();
    this.onAltered();
  }

  take(lines) {
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
          site.doors.push({ name: model.freshName("doors", "door"), start: from, end: to });
        }
      }
    });
    this.#altered();
  }

  async #taken(event) {
    const files = [...event.target.files];
    const described = files.find((file) => /\.ya?ml$/.test(file.name));
    const image = files.find((file) => file !== described);
    if (!image) { this.say("Choose the map's image together with its map.yaml: mark both in the dialogue."); return; }
    try {
      const bytes = new Uint8Array(await image.arrayBuffer());
      let text = "";
      for (let from = 0; from < bytes.length; from += 0x8000) text += String.fromCharCode(...bytes.subarray(from, from + 0x8000));
      const said = { image: btoa(text), name: (described ?? image).name, ...(described ? { map: await described.text() } : {}) };
      this.show(await (await this.post("/underlay", said)).json());
      this.onAltered();
      this.say(this.plan.underlay.to_scale ? "The map lies under the plan, to its scale." : "Give the picture its scale: two points and their distance, in the card Underlay.");
    } catch (error) { this.say(error.message); }
  }
}
