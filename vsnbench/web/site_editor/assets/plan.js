// The plan as SVG. The y axis of SVG points down and the site's up, so a point is drawn at (x, -y).

import { distance, outline, radians, shapeOf, targetsOf } from "./model.js";

const NS = "http://www.w3.org/2000/svg";
export const flip = ([x, y]) => `${x},${-y}`;

export function svgElement(kind, fields, parent, text) {
  const element = document.createElementNS(NS, kind);
  for (const [name, value] of Object.entries(fields)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent?.append(element);
  return element;
}

export class Plan {
  constructor(svg, model) {
    this.svg = svg;
    this.model = model;
    this.view = [-1, -9, 12, 10];
    this.underlay = null;
    this.lines = [];
    this.highlight = null;
    this.draft = null;
    this.points = [];
    this.onPoint = this.onNoPoint = null;
    this.reach = window.matchMedia("(pointer: coarse)").matches ? 14 : 7;
    this.goals = new Set();
    this.camera = () => null;
  }

  unit() { return this.view[2] / Math.max(this.svg.clientWidth, 1); }

  at(event) {
    const box = this.svg.getBoundingClientRect();
    const scale = Math.max(this.view[2] / box.width, this.view[3] / box.height);
    const left = this.view[0] + this.view[2] / 2 - (scale * box.width) / 2;
    const top = this.view[1] + this.view[3] / 2 - (scale * box.height) / 2;
    return [left + (event.clientX - box.left) * scale, -(top + (event.clientY - box.top) * scale)];
  }

  centre() { return [this.view[0] + this.view[2] / 2, -(this.view[1] + this.view[3] / 2)]; }

  zoom(factor, about = this.centre()) {
    const size = Math.min(Math.max(this.view[2] * factor, 0.5), 400) / this.view[2];
    this.view[0] = about[0] - (about[0] - this.view[0]) * size;
    this.view[1] = -about[1] - (-about[1] - this.view[1]) * size;
    this.view[2] *= size;
    this.view[3] *= size;
    this.draw();
  }

  pan(dx, dy) {
    this.view[0] -= dx;
    this.view[1] += dy;
    this.draw();
  }

  fit() {
    const { site } = this.model;
    const points = [...site.walls.flatMap((wall) => [wall.start, wall.end]), ...site.rooms.flatMap((room) => room.polygon),
      ...site.objects.map((object) => object.position), ...site.starts.map((start) => start.position)];
    if (this.underlay) {
      const { x_m: x, y_m: y, width_m: width, height_m: height, heading_rad: turn } = this.underlay;
      const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
      for (const [far, up] of [[0, 0], [width, 0], [width, height], [0, height]]) points.push([x + far * cos - up * sin, y + far * sin + up * cos]);
    }
    if (!points.length) points.push([0, 0], [10, 8]);
    const [xs, ys] = [points.map((point) => point[0]), points.map((point) => point[1])];
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const ratio = (this.svg.clientHeight || 3) / (this.svg.clientWidth || 4);
    const width = Math.max(right - left + 1.2, (high - low + 1.2) / ratio);
    this.view = [(left + right) / 2 - width / 2, -(low + high) / 2 - (width * ratio) / 2, width, width * ratio];
    this.draw();
  }

  draw() {
    const { svg, view } = this;
    svg.setAttribute("viewBox", view.join(" "));
    svg.replaceChildren();
    const { site, selected } = this.model;
    const classOf = (list, index, name) => `${name}${selected && selected[0] === list && selected[1] === index ? " p-selected" : ""}`;
    const group = svgElement("g", {}, svg);
    this.#underlay(group);
    site.rooms.forEach((room, index) => {
      svgElement("polygon", { points: room.polygon.map(flip).join(" "), class: classOf("rooms", index, `p-room${this.underlay ? " over" : ""}`), "data-of": `rooms ${index}` }, group);
    });
    this.#grid(group);
    [...site.objects.keys()].sort((a, b) => this.#height(a) - this.#height(b)).forEach((index) => this.#object(group, site.objects[index], index, classOf));
    this.#regions(group);
    site.walls.forEach((wall, index) => {
      svgElement("polygon", { points: wallOutline(wall).map(flip).join(" "), class: classOf("walls", index, "p-wall"), "data-of": `walls ${index}` }, group);
    });
    for (const list of ["windows", "doors"]) {
      site[list].forEach((each, index) => {
        const name = `p-${list.slice(0, -1)}${each.closed ? " closed" : ""}`;
        svgElement("line", { ...ends(each), class: classOf(list, index, name), "data-of": `${list} ${index}` }, group);
      });
    }
    site.rooms.forEach((room) => this.#text(group, middle(room.polygon), room.name, 13));
    site.starts.forEach((start, index) => this.#start(group, start, index, classOf));
    this.lines.forEach((line, index) => {
      svgElement("line", { ...ends(line), class: "p-line", "data-of": `lines ${index}` }, group);
      for (const doorway of line.doorways) svgElement("line", { ...ends(doorway), class: "p-door", "data-of": `lines ${index}` }, group);
    });
    this.#goal(group);
    this.#handles(group);
    if (this.draft) {
      svgElement("polyline", { points: this.draft.map(flip).join(" "), class: "p-draft" }, group);
      if (this.draft.length > 1) {
        const [from, to] = this.draft.slice(-2);
        this.#text(group, middle([from, to]), `${distance(from, to).toFixed(2)} m`, 14);
      }
    }
    for (const point of this.points) svgElement("circle", { cx: point[0], cy: -point[1], r: 5 * this.unit(), class: "p-draft" }, group);
    this.#highlight(group);
  }

  #height(index) {
    const object = this.model.site.objects[index];
    return (object.elevation_m ?? 0) + (object.solid === false ? -1 : 0);
  }

  #underlay(group) {
    const { underlay } = this;
    if (!underlay || underlay.hidden) return;
    const turn = (-underlay.heading_rad * 180) / Math.PI;
    svgElement("image", {
      href: underlay.href, x: 0, y: -underlay.height_m, width: underlay.width_m, height: underlay.height_m, opacity: 0.7,
      preserveAspectRatio: "none", transform: `translate(${underlay.x_m} ${-underlay.y_m}) rotate(${turn})`,
    }, group);
  }

  #grid(group) {
    const step = this.view[2] > 60 ? 10 : this.view[2] > 30 ? 5 : this.view[2] < 3 ? 0.25 : 1;
    const [left, top, width, height] = this.view;
    for (let x = Math.ceil(left / step) * step; x < left + width; x += step) {
      svgElement("line", { x1: x, y1: top, x2: x, y2: top + height, class: Math.abs(x) < 1e-9 ? "p-axis" : "p-grid" }, group);
      this.#text(group, [x, -(top + 14 * this.unit())], `${Number(x.toFixed(2))}`, 10);
    }
    for (let y = Math.ceil(top / step) * step; y < top + height; y += step) {
      svgElement("line", { x1: left, y1: y, x2: left + width, y2: y, class: Math.abs(y) < 1e-9 ? "p-axis" : "p-grid" }, group);
      this.#text(group, [left + 16 * this.unit(), -(y + 3 * this.unit())], `${Number((-y).toFixed(2))}`, 10);
    }
  }

  // Regions and points of all goals; those of the selected goal stand out.
  #regions(group) {
    const { site, selected } = this.model;
    site.goals.forEach((goal, index) => {
      const isMine = selected?.[0] === "goals" && selected[1] === index;
      targetsOf(goal).forEach((target, number) => {
        const shape = shapeOf(target);
        if (!shape) return;
        const isSelected = isMine && selected[2] === number;
        const fields = { class: `p-${shape}${isMine ? " mine" : ""}${isSelected ? " p-selected" : ""}`, "data-of": `goals ${index} ${number}` };
        if (shape === "region") svgElement("polygon", { points: target.region.map(flip).join(" "), ...fields }, group);
        else svgElement("circle", { cx: target.point[0], cy: -target.point[1], r: 7 * this.unit(), ...fields }, group);
        const at = shape === "region" ? middle(target.region) : [target.point[0], target.point[1] + 11 * this.unit()];
        this.#text(group, at, `${goal.id}${target.name ? `: ${target.name}` : ""}`, 11);
      });
    });
  }

  // Target objects and starts of the selected goal, and the camera of its photograph.
  #goal(group) {
    const { site, selected } = this.model;
    const goal = selected?.[0] === "goals" ? site.goals[selected[1]] : null;
    if (!goal) return;
    const targets = targetsOf(goal);
    const categories = new Set([...targets.map((target) => target.category), ...(targets.length ? [] : [goal.category])]);
    const ids = new Set(targets.map((target) => target.object ?? target));
    for (const object of site.objects) {
      if (ids.has(object.id) || categories.has(object.category)) svgElement("polygon", { points: outline(object).map(flip).join(" "), class: "p-target" }, group);
    }
    for (const { number, position } of site.starts) {
      if (Array.isArray(goal.starts) && goal.starts.includes(number)) svgElement("circle", { cx: position[0], cy: -position[1], r: 0.22, class: "p-target" }, group);
    }
    const camera = this.camera();
    if (!camera) return;
    const { x_m: x, y_m: y, heading_deg: heading } = camera;
    const ray = (turned) => `${x + Math.cos(radians(heading + turned))} ${-(y + Math.sin(radians(heading + turned)))}`;
    svgElement("path", { d: `M${x} ${-y}L${ray(30)}L${ray(-30)}Z`, class: "p-camera" }, group);
    svgElement("circle", { cx: x, cy: -y, r: 6 * this.unit(), class: "p-camera lens" }, group);
  }

  #object(group, object, index, classOf) {
    const corners = outline(object);
    const kind = `p-object${this.goals.has(object.category) ? " goal" : ""}${object.solid === false ? " flat" : ""}`;
    svgElement("polygon", { points: corners.map(flip).join(" "), class: classOf("objects", index, kind), "data-of": `objects ${index}` }, group);
    const turn = radians(object.heading_deg ?? 0);
    const front = object.size_m[0] / 2;
    const nose = (far, side) => [object.position[0] + Math.cos(turn) * far - Math.sin(turn) * side, object.position[1] + Math.sin(turn) * far + Math.cos(turn) * side];
    const tip = Math.min(0.08, front / 2);
    svgElement("polyline", { points: [nose(front - tip, tip), nose(front, 0), nose(front - tip, -tip)].map(flip).join(" "), class: "p-front" }, group);
    if (Math.max(...object.size_m) / this.unit() > 45) this.#text(group, object.position, object.category.replaceAll("_", " "), 11);
  }

  #start(group, start, index, classOf) {
    const [x, y] = start.position;
    const turn = radians(start.heading_deg ?? 0);
    const radius = 0.16;
    svgElement("line", { x1: x, y1: -y, x2: x + 0.34 * Math.cos(turn), y2: -(y + 0.34 * Math.sin(turn)), class: "p-heading" }, group);
    svgElement("circle", { cx: x, cy: -y, r: radius, class: classOf("starts", index, "p-start"), "data-of": `starts ${index}` }, group);
    this.#text(group, [x, y - 4 * this.unit()], `${start.number}`, 12);
  }

  #handles(group) {
    const entry = this.model.entry();
    if (!entry) return;
    const radius = this.reach * this.unit();
    const handle = (at, name, size = 1) => svgElement("circle", { cx: at[0], cy: -at[1], r: radius * size, class: `p-handle${size < 1 ? " new" : ""}`, "data-handle": name }, group);
    const corners = (field) => {
      const all = entry[field];
      all.forEach((corner, index) => {
        const next = all[(index + 1) % all.length];
        if (distance(corner, next) > 4 * radius) handle(middle([corner, next]), `${field} ${index + 1} new`, 0.7);
      });
      all.forEach((corner, index) => handle(corner, `${field} ${index}`));
    };
    if (entry.start) {
      handle(entry.start, "start");
      handle(entry.end, "end");
      this.#text(group, middle([entry.start, entry.end]), `${distance(entry.start, entry.end).toFixed(2)} m`, 14);
    } else if (entry.polygon) corners("polygon");
    else if (entry.region && shapeOf(entry)) corners("region");
    else if (entry.position) {
      const far = (entry.size_m ? entry.size_m[0] / 2 : 0.16) + 0.25;
      const turn = radians(entry.heading_deg ?? 0);
      handle([entry.position[0] + far * Math.cos(turn), entry.position[1] + far * Math.sin(turn)], "turn");
      if (entry.footprint) corners("footprint");
      else if (entry.size_m) handle(outline(entry)[0], "size");
    }
  }

  #highlight(group) {
    if (!this.highlight) return;
    const { type, coordinates } = this.highlight;
    if (type === "Polygon") svgElement("polygon", { points: coordinates[0].map(flip).join(" "), class: "p-highlight" }, group);
    if (type === "LineString") svgElement("polyline", { points: coordinates.map(flip).join(" "), class: "p-highlight" }, group);
    if (type === "MultiPoint") for (const [x, y] of coordinates) svgElement("circle", { cx: x, cy: -y, r: 16 * this.unit(), class: "p-highlight" }, group);
  }

  #text(group, at, text, pixels) {
    const size = pixels * this.unit();
    svgElement("text", { x: at[0], y: -at[1], "font-size": size, "stroke-width": size / 5, class: "p-text" }, group, text);
  }
}

const ends = (each) => ({ x1: each.start[0], y1: -each.start[1], x2: each.end[0], y2: -each.end[1] });

export function middle(points) {
  return [points.reduce((sum, point) => sum + point[0], 0) / points.length, points.reduce((sum, point) => sum + point[1], 0) / points.length];
}

function wallOutline(wall) {
  const half = (wall.thickness_m ?? 0.1) / 2;
  const length = distance(wall.start, wall.end) || 1;
  const [ax, ay] = [((wall.end[0] - wall.start[0]) / length) * half, ((wall.end[1] - wall.start[1]) / length) * half];
  const [s, e] = [[wall.start[0] - ax, wall.start[1] - ay], [wall.end[0] + ax, wall.end[1] + ay]];
  return [[s[0] - ay, s[1] + ax], [e[0] - ay, e[1] + ax], [e[0] + ay, e[1] - ax], [s[0] + ay, s[1] - ax]];
}
