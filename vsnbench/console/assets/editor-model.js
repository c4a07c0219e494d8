// The site that is drawn: its lists, undo and redo, and the geometry of snapping. Metres, y up, headings in degrees.

export const LISTS = ["rooms", "walls", "doors", "windows", "objects", "starts"];
export const GRID_M = 0.05;
const REACH_M = 0.15;

export const SIZES = {
  chair: [0.5, 0.5, 0.9], sofa: [0.9, 2.0, 0.8], table: [0.8, 1.4, 0.75], bed: [2.0, 1.5, 0.55], toilet: [0.68, 0.4, 0.78],
  monitor: [0.2, 0.9, 0.6], plant: [0.45, 0.45, 1.1], bathtub: [0.75, 1.6, 0.55], bookshelf: [0.3, 0.9, 1.9],
  cabinet: [0.4, 1.2, 0.85], counter: [0.6, 1.2, 0.9], lamp: [0.35, 0.35, 1.6], nightstand: [0.42, 0.44, 0.5],
  picture: [0.03, 0.8, 0.6], refrigerator: [0.7, 0.7, 1.85], rug: [1.4, 2.0, 0.01], shower: [0.9, 0.9, 2.0],
  sink: [0.48, 0.6, 0.85], stove: [0.6, 0.6, 0.9], wall_cabinet: [0.34, 1.2, 0.7], wardrobe: [0.6, 1.3, 2.1],
  washing_machine: [0.6, 0.6, 0.85],
};

export const rounded = (value, step = 0.001) => Math.round(Math.round(value / step) * step * 10000) / 10000;
export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
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
    this.chosen = null;
  }

  say() { this.dispatchEvent(new Event("change")); }

  // Every change is a step of undo; `group` joins the moves of one drag.
  change(alter, group = null) {
    if (group === null || group !== this.group) {
      this.past.push(JSON.stringify(this.site));
      if (this.past.length > 300) this.past.shift();
    }
    this.group = group;
    this.future = [];
    alter(this.site);
    this.say();
  }

  undo() { this.#step(this.past, this.future); }
  redo() { this.#step(this.future, this.past); }

  #step(from, to) {
    if (!from.length) return;
    to.push(JSON.stringify(this.site));
    this.site = JSON.parse(from.pop());
    this.group = null;
    if (this.chosen && !this.entry()) this.chosen = null;
    this.say();
  }

  // After saving, entries are known by their new places in the file.
  renumber(site) {
    for (const list of LISTS) this.site[list].forEach((entry, index) => { entry._was = site[list][index]?._was ?? null; });
    this.past = [];
    this.future = [];
  }

  entry(chosen = this.chosen) { return chosen ? this.site[chosen[0]][chosen[1]] : undefined; }

  choose(chosen) {
    this.chosen = chosen;
    this.dispatchEvent(new Event("choice"));
  }

  add(list, entry) {
    this.change((site) => site[list].push(entry));
    this.choose([list, this.site[list].length - 1]);
  }

  remove() {
    if (!this.chosen) return;
    const [list, index] = this.chosen;
    this.chosen = null;
    this.change((site) => site[list].splice(index, 1));
    this.choose(null);
  }

  freshId(category) {
    const taken = new Set(this.site.objects.map((thing) => thing.id));
    for (let number = 1; ; number += 1) {
      const id = `${category.replaceAll("_", "-")}-${number}`;
      if (!taken.has(id)) return id;
    }
  }

  freshName(list, what) {
    const taken = new Set(this.site[list].map((entry) => entry.name));
    for (let number = 1; ; number += 1) if (!taken.has(`${what} ${number}`)) return `${what} ${number}`;
  }

  freshNumber() { return 1 + Math.max(0, ...this.site.starts.map((start) => start.number || 0)); }

  // The nearest end, corner or crossing of what is there, else the grid; straight from `from` within 3 degrees.
  snapped(point, from = null, reach = REACH_M) {
    let best = null;
    let away = reach;
    const consider = (other) => {
      const off = distance(point, other);
      if (off < away) { best = other; away = off; }
    };
    this.site.walls.forEach((wall) => { consider(wall.start); consider(wall.end); });
    this.site.rooms.forEach((room) => room.polygon.forEach(consider));
    if (!best) {
      for (const wall of this.site.walls) {
        const on = nearestOn(wall.start, wall.end, point);
        if (distance(point, on) < Math.min(away, reach * 0.7)) { best = on; away = distance(point, on); }
      }
    }
    if (best) return [rounded(best[0]), rounded(best[1])];
    const grid = [rounded(point[0], GRID_M), rounded(point[1], GRID_M)];
    if (from) {
      if (Math.abs(point[0] - from[0]) < 0.06 * distance(point, from)) grid[0] = from[0];
      if (Math.abs(point[1] - from[1]) < 0.06 * distance(point, from)) grid[1] = from[1];
    }
    return grid;
  }

  // An opening lies on the nearest wall's centre line.
  onWall(point) {
    let best = null;
    let away = 0.5;
    for (const wall of this.site.walls) {
      const on = nearestOn(wall.start, wall.end, point);
      if (distance(point, on) < away) { best = { wall, on }; away = distance(point, on); }
    }
    return best;
  }

  opening(point, length) {
    const found = this.onWall(point);
    if (!found) return null;
    const { wall, on } = found;
    const whole = distance(wall.start, wall.end);
    const way = [(wall.end[0] - wall.start[0]) / whole, (wall.end[1] - wall.start[1]) / whole];
    const half = Math.min(length, whole) / 2;
    const at = Math.min(Math.max(distance(wall.start, on), half), whole - half);
    const along = (far) => [rounded(wall.start[0] + way[0] * far), rounded(wall.start[1] + way[1] * far)];
    return { start: along(at - half), end: along(at + half) };
  }
}

export function nearestOn(start, end, point) {
  const way = [end[0] - start[0], end[1] - start[1]];
  const square = way[0] ** 2 + way[1] ** 2 || 1;
  const share = Math.min(1, Math.max(0, ((point[0] - start[0]) * way[0] + (point[1] - start[1]) * way[1]) / square));
  return [start[0] + share * way[0], start[1] + share * way[1]];
}

// The corners of an object's footprint in the site's frame.
export function outline(thing) {
  if (thing.footprint) return thing.footprint;
  const [depth, width] = thing.size_m;
  const turn = radians(thing.heading_deg ?? 0);
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([front, left]) => {
    const x = (front * depth) / 2;
    const y = (left * width) / 2;
    return [thing.position[0] + Math.cos(turn) * x - Math.sin(turn) * y, thing.position[1] + Math.sin(turn) * x + Math.cos(turn) * y];
  });
}

// The box that an outline fills, along the heading: where its look in simulation stands, and how large it is.
export function boxed(thing) {
  if (!thing.footprint) return;
  const turn = radians(thing.heading_deg ?? 0);
  const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
  const [along, across] = [thing.footprint.map(([x, y]) => x * cos + y * sin), thing.footprint.map(([x, y]) => y * cos - x * sin)];
  const [low, high] = [[Math.min(...along), Math.min(...across)], [Math.max(...along), Math.max(...across)]];
  const [far, side] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  thing.position = [rounded(far * cos - side * sin), rounded(far * sin + side * cos)];
  thing.size_m = [Math.max(rounded(high[0] - low[0]), 0.02), Math.max(rounded(high[1] - low[1]), 0.02), thing.size_m[2]];
}

export function moved(entry, dx, dy) {
  const shift = ([x, y]) => [rounded(x + dx), rounded(y + dy)];
  for (const field of ["position", "start", "end"]) if (entry[field]) entry[field] = shift(entry[field]);
  for (const field of ["polygon", "footprint"]) if (entry[field]) entry[field] = entry[field].map(shift);
}

export function turned(entry, degrees) {
  if (entry.heading_deg === undefined && entry.position === undefined) return;
  const wrapped = ((((entry.heading_deg ?? 0) + degrees + 180) % 360) + 360) % 360 - 180;
  entry.heading_deg = rounded(wrapped, 0.1);
  if (entry.footprint) {
    const turn = radians(degrees);
    entry.footprint = entry.footprint.map(([x, y]) => {
      const [dx, dy] = [x - entry.position[0], y - entry.position[1]];
      return [rounded(entry.position[0] + dx * Math.cos(turn) - dy * Math.sin(turn)), rounded(entry.position[1] + dx * Math.sin(turn) + dy * Math.cos(turn))];
    });
  }
}

export function titled(list, entry, index) {
  if (list === "objects") return `${entry.id} (${entry.category})`;
  if (list === "starts") return `start ${entry.number}`;
  if (list === "walls" || list === "windows") {
    const length = entry.start && entry.end ? distance(entry.start, entry.end).toFixed(2) : "?";
    return `${list.slice(0, -1)} ${index + 1}, ${length} m`;
  }
  return `${list.slice(0, -1)} ${entry.name ?? index + 1}`;
}
