// The edited site, with selection, undo and redo. Metres, y up, headings in degrees.

import { along, distance, gridAlong, nearestOn, nearestWall, rounded, snapped } from "./snapping.js";

export { distance, nearestOn, rounded };

export const LISTS = ["rooms", "walls", "doors", "windows", "objects", "starts", "goals"];
const OPENING_REACH_M = 0.5;

export const SIZES = {
  chair: [0.5, 0.5, 0.9], sofa: [0.9, 2.0, 0.8], table: [0.8, 1.4, 0.75], bed: [2.0, 1.5, 0.55], toilet: [0.68, 0.4, 0.78],
  monitor: [0.2, 0.9, 0.6], plant: [0.45, 0.45, 1.1], bathtub: [0.75, 1.6, 0.55], bookshelf: [0.3, 0.9, 1.9],
  cabinet: [0.4, 1.2, 0.85], counter: [0.6, 1.2, 0.9], lamp: [0.35, 0.35, 1.6], nightstand: [0.42, 0.44, 0.5],
  picture: [0.03, 0.8, 0.6], refrigerator: [0.7, 0.7, 1.85], rug: [1.4, 2.0, 0.01], shower: [0.9, 0.9, 2.0],
  sink: [0.48, 0.6, 0.85], stove: [0.6, 0.6, 0.9], wall_cabinet: [0.34, 1.2, 0.7], wardrobe: [0.6, 1.3, 2.1],
  washing_machine: [0.6, 0.6, 0.85],
};

export const radians = (degrees) => (degrees * Math.PI) / 180;

export class Model extends EventTarget {
  constructor(site) {
    super();
    this.past = [];
    this.future = [];
    this.take(site);
  }

  take(site) {
    this.site = site;
    for (const list of LISTS) this.site[list] = this.site[list] ?? [];
    this.selected = null;
  }

  notify() { this.dispatchEvent(new Event("change")); }

  // Applies a change as one undo step. Changes with the same `group`, as of one drag, share a step.
  change(apply, group = null) {
    if (group === null || group !== this.group) {
      this.past.push(JSON.stringify(this.site));
      if (this.past.length > 300) this.past.shift();
    }
    this.group = group;
    this.future = [];
    apply(this.site);
    this.notify();
  }

  undo() { this.#step(this.past, this.future); }
  redo() { this.#step(this.future, this.past); }

  #step(from, to) {
    if (!from.length) return;
    to.push(JSON.stringify(this.site));
    this.site = JSON.parse(from.pop());
    this.group = null;
    if (this.selected && !this.entry()) this.selected = null;
    this.notify();
  }

  // After a save, entries have new positions in the file.
  renumber(site) {
    for (const list of LISTS) this.site[list].forEach((entry, index) => { entry._index = site[list][index]?._index ?? null; });
    this.past = [];
    this.future = [];
  }

  // The selected entry. A third part of the selection is the index of a goal's target.
  entry(selected = this.selected) {
    const entry = selected ? this.site[selected[0]][selected[1]] : undefined;
    return selected?.length > 2 ? entry?.targets?.[selected[2]] : entry;
  }

  select(selected) {
    this.selected = selected;
    this.dispatchEvent(new Event("selection"));
  }

  add(list, entry) {
    this.change((site) => site[list].push(entry));
    this.select([list, this.site[list].length - 1]);
  }

  remove() {
    if (!this.selected) return;
    const [list, index, target] = this.selected;
    const rest = target === undefined ? null : [list, index];
    this.selected = rest;
    this.change((site) => (rest ? site[list][index].targets.splice(target, 1) : site[list].splice(index, 1)));
    this.select(rest);
  }

  newId(category) {
    const taken = new Set(this.site.objects.map((object) => object.id));
    for (let number = 1; ; number += 1) {
      const id = `${category.replaceAll("_", "-")}-${number}`;
      if (!taken.has(id)) return id;
    }
  }

  newName(list, what) {
    const taken = new Set(this.site[list].map((entry) => entry.name));
    for (let number = 1; ; number += 1) if (!taken.has(`${what} ${number}`)) return `${what} ${number}`;
  }

  newGoalId() {
    const taken = new Set(this.site.goals.map((goal) => goal.id));
    for (let number = 1; ; number += 1) if (!taken.has(`goal-${number}`)) return `goal-${number}`;
  }

  // Renames an object or renumbers a start, also in the goals that name it.
  rename(list, before, after) {
    const names = this.site[list].map((entry) => (list === "starts" ? entry.number : entry.id));
    if (names.includes(after) || names.indexOf(before) !== names.lastIndexOf(before)) return;
    const renamed = (value) => (value === before ? after : value);
    for (const goal of this.site.goals) {
      if (list === "starts" && Array.isArray(goal.starts)) goal.starts = goal.starts.map(renamed);
      if (list === "objects" && targetsOf(goal).length) goal.targets = targetsOf(goal).map((target) => (target?.object === before ? { ...target, object: after } : renamed(target)));
    }
  }

  newNumber() { return 1 + Math.max(0, ...this.site.starts.map((start) => start.number || 0)); }

  // Snaps a point. Options as of `snapped`, and `but`: the dragged entry, which does not snap to itself.
  snapped(point, { but = null, ...options } = {}) {
    const walls = this.site.walls.filter((wall) => wall !== but?.entry);
    const rooms = this.site.rooms.map((room) => (room === but?.entry ? { polygon: room.polygon.filter((_, i) => i !== but.index) } : room));
    return snapped({ walls, rooms }, point, options);
  }

  // Snaps the end of an opening to the nearest wall's centre line, and to the grid along it.
  onWall(point, free = false) {
    const wall = nearestWall(this.site, point, OPENING_REACH_M);
    if (!wall) return null;
    const far = distance(wall.start, nearestOn(wall.start, wall.end, point));
    return along(wall, free ? far : gridAlong(wall, far));
  }

  opening(point, length, free = false) {
    const wall = nearestWall(this.site, point, OPENING_REACH_M);
    if (!wall) return null;
    const whole = distance(wall.start, wall.end);
    const fits = Math.min(length, whole);
    const first = distance(wall.start, nearestOn(wall.start, wall.end, point)) - fits / 2;
    const start = Math.min(Math.max(free ? first : gridAlong(wall, first), 0), whole - fits);
    return { start: along(wall, start), end: along(wall, start + fits) };
  }
}

// The targets of a goal; none if the file has something else than a list.
export const targetsOf = (goal) => (Array.isArray(goal?.targets) ? goal.targets.map((target) => target ?? "") : []);

const isPoint = (point) => Array.isArray(point) && point.length === 2 && point.every(Number.isFinite);

// The shape of a target that is not an object: "region", "point" or null.
export function shapeOf(target) {
  if (Array.isArray(target.region) && target.region.every(isPoint)) return "region";
  return isPoint(target.point) ? "point" : null;
}

// Corners of an object's footprint in the site's frame.
export function outline(object) {
  if (object.footprint) return object.footprint;
  const [depth, width] = object.size_m;
  const turn = radians(object.heading_deg ?? 0);
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([front, left]) => {
    const x = (front * depth) / 2;
    const y = (left * width) / 2;
    return [object.position[0] + Math.cos(turn) * x - Math.sin(turn) * y, object.position[1] + Math.sin(turn) * x + Math.cos(turn) * y];
  });
}

// Sets position and size of an object to the bounding box of its footprint, along its heading.
export function fitBox(object) {
  if (!object.footprint) return;
  const turn = radians(object.heading_deg ?? 0);
  const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
  const [along, across] = [object.footprint.map(([x, y]) => x * cos + y * sin), object.footprint.map(([x, y]) => y * cos - x * sin)];
  const [low, high] = [[Math.min(...along), Math.min(...across)], [Math.max(...along), Math.max(...across)]];
  const [far, side] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  object.position = [rounded(far * cos - side * sin), rounded(far * sin + side * cos)];
  object.size_m = [Math.max(rounded(high[0] - low[0]), 0.02), Math.max(rounded(high[1] - low[1]), 0.02), object.size_m[2]];
}

export function move(entry, dx, dy) {
  const shift = ([x, y]) => [rounded(x + dx), rounded(y + dy)];
  for (const field of ["position", "start", "end", "point"]) if (entry[field]) entry[field] = shift(entry[field]);
  for (const field of ["polygon", "footprint", "region"]) if (entry[field]) entry[field] = entry[field].map(shift);
}

export function rotate(entry, degrees) {
  if (entry.heading_deg === undefined && entry.position === undefined) return;
  const wrapped = ((((entry.heading_deg ?? 0) + degrees + 180) % 360) + 360) % 360 - 180;
  entry.heading_deg = rounded(wrapped, 0.1);
  if (entry.footprint) {
    const angle = radians(degrees);
    entry.footprint = entry.footprint.map(([x, y]) => {
      const [dx, dy] = [x - entry.position[0], y - entry.position[1]];
      return [rounded(entry.position[0] + dx * Math.cos(angle) - dy * Math.sin(angle)), rounded(entry.position[1] + dx * Math.sin(angle) + dy * Math.cos(angle))];
    });
  }
}

export function titleOf(list, entry, index) {
  if (list === "objects") return `${entry.id} (${entry.category})`;
  if (list === "starts") return `start ${entry.number}`;
  if (list === "goals") return entry.kind ? `goal ${entry.id} (${entry.kind})` : `${entry.region ? "region" : "point"} ${entry.name ?? ""}`.trim();
  if (list === "walls" || list === "windows") {
    const length = entry.start && entry.end ? distance(entry.start, entry.end).toFixed(2) : "?";
    return `${list.slice(0, -1)} ${index + 1}, ${length} m`;
  }
  return `${list.slice(0, -1)} ${entry.name ?? index + 1}`;
}
