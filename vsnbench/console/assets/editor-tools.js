// What pointer and keys do on the plan: choose, draw, drag, turn, pan and pinch.

import { SIZES, boxed, distance, moved, radians, rounded, turned } from "./editor-model.js";

export const TOOLS = [
  ["choose", "Choose", "Click a thing to choose it, drag to move it; drag the ground to pan."],
  ["wall", "Wall", "Click one end, then the next, or drag; typing a length and Enter sets it. Escape ends."],
  ["room", "Room", "Click its corners in order; Enter, or the first corner again, closes it."],
  ["door", "Door", "Click a wall: a door of 0.80 m lies on its centre line."],
  ["window", "Window", "Click a wall: a window of 1.20 m lies on its centre line."],
  ["start", "Start", "Click where the robot begins; drag before letting go to say where it looks."],
];

const FINGER_PX = 10;
const DRAWN_PX = 20;

export class Tools {
  constructor(plan, model, say) {
    Object.assign(this, { plan, model, say, tool: "choose", typed: "", pointers: new Map(), drag: null, tap: null, draft: [] });
    const { svg } = plan;
    svg.addEventListener("pointerdown", (event) => this.#down(event));
    svg.addEventListener("pointermove", (event) => this.#move(event));
    for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, (event) => this.#up(event));
    svg.addEventListener("wheel", (event) => {
      event.preventDefault();
      plan.zoom(Math.exp(event.deltaY * 0.0015), plan.at(event));
    }, { passive: false });
    svg.addEventListener("keydown", (event) => this.#key(event));
  }

  use(tool) {
    this.tool = tool;
    this.#end();
    const words = TOOLS.find(([name]) => name === tool)?.[2] ?? `Click where the ${tool.replaceAll("_", " ")} stands.`;
    this.say(words);
  }

  // By keyboard: what a tool draws is put into the middle of what is seen.
  place() {
    const at = this.model.snapped(this.plan.centre());
    if (this.tool === "wall") this.model.add("walls", { start: at, end: [rounded(at[0] + 2), at[1]] });
    else if (this.tool === "room") this.model.add("rooms", { name: this.model.freshName("rooms", "room"), polygon: [at, [at[0] + 3, at[1]], [at[0] + 3, at[1] + 3], [at[0], at[1] + 3]] });
    else if (this.tool !== "choose") this.#put(at);
  }

  #down(event) {
    const { plan, model } = this;
    plan.svg.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.pointers.size > 1) { this.drag = this.tap = null; return; }
    const { target, shiftKey, clientX, clientY } = event;
    this.tap = { at: plan.at(event), target, shiftKey, from: [clientX, clientY], waits: false };
    // A finger may be the first of two that pinch: what it puts waits until it moves alone, or is lifted.
    const puts = plan.onPoint || this.tool !== "choose" || target.dataset?.of?.startsWith("lines");
    if (event.pointerType === "touch" && puts) this.tap.waits = true;
    else this.#pressed();
  }

  #pressed() {
    const { plan, model } = this;
    const { at, target, shiftKey } = this.tap;
    this.tap.waits = false;
    const handle = target.dataset?.handle;
    const of = target.dataset?.of?.split(" ");
    if (plan.onPoint) { plan.onPoint(at); return; }
    if (of?.[0] === "lines" && this.tool === "choose") { plan.onLine(Number(of[1]), shiftKey); return; }
    // Before the handles of what is chosen: a new room begins in the corner of the one that was just drawn.
    if (this.tool === "wall") { this.#corner(at); return; }
    if (this.tool === "room") { this.#roomCorner(at); return; }
    if (handle && model.entry()) { this.drag = { kind: "handle", handle, group: Symbol(handle) }; return; }
    if (this.tool !== "choose") { this.#put(at); return; }
    if (of) {
      model.choose([of[0], Number(of[1])]);
      this.drag = { kind: "move", from: at, group: Symbol("move") };
    } else {
      model.choose(null);
      this.drag = { kind: "pan", from: at };
    }
  }

  #move(event) {
    const { plan, model } = this;
    const before = this.pointers.get(event.pointerId);
    if (before && this.pointers.size === 2) { this.#pinch(event, before); return; }
    const at = plan.at(event);
    if (before && this.tap?.waits && distance(this.tap.from, [event.clientX, event.clientY]) > FINGER_PX) this.#pressed();
    if (this.draft.length && !this.tap?.waits) {
      plan.draft = [...this.draft, model.snapped(at, this.draft.at(-1))];
      plan.draw();
      return;
    }
    if (!before || !this.drag) return;
    if (this.drag.kind === "pan") { plan.pan(at[0] - this.drag.from[0], at[1] - this.drag.from[1]); return; }
    if (this.drag.kind === "move") {
      const step = [at[0] - this.drag.from[0], at[1] - this.drag.from[1]].map((each) => rounded(each, event.altKey ? 0.01 : 0.05));
      if (step[0] || step[1]) {
        model.change(() => this.#shift(model.entry(), step, at), this.drag.group);
        this.drag.from = [this.drag.from[0] + step[0], this.drag.from[1] + step[1]];
      }
      return;
    }
    model.change(() => this.#handled(model.entry(), at), this.drag.group);
  }

  #shift(entry, step, at) {
    const list = this.model.chosen[0];
    if (list === "doors" || list === "windows") {
      const found = this.model.opening(at, distance(entry.start, entry.end));
      if (found) Object.assign(entry, found);
    } else moved(entry, step[0], step[1]);
  }

  #handled(entry, at) {
    const { handle } = this.drag;
    const list = this.model.chosen[0];
    if (handle === "turn") {
      const turn = (Math.atan2(at[1] - entry.position[1], at[0] - entry.position[0]) * 180) / Math.PI;
      turned(entry, rounded(turn, 5) - (entry.heading_deg ?? 0));
    } else if (handle === "size") {
      const turn = radians(entry.heading_deg ?? 0);
      const [dx, dy] = [at[0] - entry.position[0], at[1] - entry.position[1]];
      const depth = Math.abs(Math.cos(turn) * dx + Math.sin(turn) * dy) * 2;
      const width = Math.abs(-Math.sin(turn) * dx + Math.cos(turn) * dy) * 2;
      entry.size_m = [Math.max(rounded(depth, 0.02), 0.02), Math.max(rounded(width, 0.02), 0.02), entry.size_m[2]];
    } else if (handle.includes(" ")) {
      const [field, index, isNew] = handle.split(" ");
      if (isNew) {
        entry[field].splice(Number(index), 0, at);
        this.drag.handle = `${field} ${index}`;
      }
      entry[field][Number(index)] = this.model.snapped(at, null, field === "footprint" ? 0 : undefined);
      boxed(entry);
    } else if (list === "walls") {
      const other = handle === "start" ? entry.end : entry.start;
      entry[handle] = [-99, -99];
      entry[handle] = this.model.snapped(at, other);
    } else {
      const found = this.model.onWall(at);
      if (found) entry[handle] = found.on.map((each) => rounded(each));
    }
  }

  #up(event) {
    this.pointers.delete(event.pointerId);
    const { tap } = this;
    this.tap = null;
    if (tap && event.type === "pointerup") {
      if (tap.waits) { this.tap = tap; this.#pressed(); this.tap = null; }
      else if (this.draft.length && distance(tap.from, [event.clientX, event.clientY]) > DRAWN_PX) this.#drawn(this.plan.at(event));
    }
    if (this.drag?.kind !== "pan") this.plan.onSettled?.();
    this.drag = null;
  }

  // A wall or an edge of a room that was dragged ends where the pointer is let go.
  #drawn(at) {
    if (this.tool === "wall") this.#corner(at);
    else this.#roomCorner(at);
  }

  #pinch(event, before) {
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
    const now = [event.clientX, event.clientY];
    const about = this.plan.at({ clientX: (now[0] + other[0]) / 2, clientY: (now[1] + other[1]) / 2 });
    this.plan.zoom(distance(before, other) / Math.max(distance(now, other), 1), about);
    const unit = this.plan.unit();
    this.plan.pan(((now[0] - before[0]) * unit) / 2, (-(now[1] - before[1]) * unit) / 2);
    this.pointers.set(event.pointerId, now);
  }

  #corner(at) {
    const point = this.model.snapped(at, this.draft.at(-1) ?? null);
    const last = this.draft.at(-1);
    if (last && distance(last, point) > 0.02) {
      this.model.add("walls", { start: last, end: point });
      this.draft = [point];
    } else if (last) this.#end();
    else this.draft = [point];
    this.plan.draft = this.draft.length ? [...this.draft] : null;
    this.plan.draw();
  }

  #roomCorner(at) {
    const point = this.model.snapped(at, this.draft.at(-1) ?? null);
    if (this.draft.length > 2 && distance(point, this.draft[0]) < 0.02) { this.#closeRoom(); return; }
    this.draft.push(point);
    this.plan.draft = [...this.draft];
    this.plan.draw();
  }

  #closeRoom() {
    const polygon = this.draft;
    this.#end();
    if (polygon.length > 2) this.model.add("rooms", { name: this.model.freshName("rooms", "room"), polygon });
  }

  #put(at) {
    const { model, tool } = this;
    if (tool === "door" || tool === "window") {
      const found = model.opening(at, tool === "door" ? 0.8 : 1.2);
      if (!found) { this.say(`A ${tool} lies on a wall: click nearer to one.`); return; }
      if (tool === "door") model.add("doors", { name: model.freshName("doors", "door"), ...found });
      else model.add("windows", found);
      return;
    }
    const position = at.map((each) => rounded(each, 0.05));
    if (tool === "start") {
      model.add("starts", { number: model.freshNumber(), position, heading_deg: 0 });
      this.drag = { kind: "handle", handle: "turn", group: Symbol("turn") };
      return;
    }
    model.add("objects", { id: model.freshId(tool), category: tool, position, heading_deg: 0, size_m: [...SIZES[tool]], ...(tool === "rug" ? { solid: false } : {}) });
  }

  #end() {
    if (this.plan.onPoint) this.plan.onNoPoint?.();
    this.draft = [];
    this.typed = "";
    this.plan.draft = null;
    this.plan.draw();
  }

  #key(event) {
    const { model, plan } = this;
    const step = event.shiftKey ? 0.01 : event.altKey ? 0.5 : 0.05;
    const ways = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
    if (event.ctrlKey || event.metaKey) return;
    if (this.draft.length && /^[0-9.]$/.test(event.key)) {
      this.typed += event.key;
      this.say(`Length: ${this.typed} m; Enter sets it in the direction of the pointer.`);
    } else if (event.key === "Enter" && this.tool === "room" && this.draft.length > 2) this.#closeRoom();
    else if (event.key === "Enter" && this.draft.length && Number(this.typed) > 0 && plan.draft?.length > 1) {
      const [from, to] = plan.draft.slice(-2);
      const share = Number(this.typed) / (distance(from, to) || 1);
      const end = [rounded(from[0] + (to[0] - from[0]) * share), rounded(from[1] + (to[1] - from[1]) * share)];
      this.typed = "";
      if (this.tool === "wall") { model.add("walls", { start: from, end }); this.draft = [end]; } else this.draft.push(end);
      plan.draft = [...this.draft];
      plan.draw();
    } else if (event.key === "Enter" && this.tool !== "choose" && !this.draft.length) this.place();
    else if (event.key === "Escape") { this.#end(); model.choose(null); }
    else if (ways[event.key] && model.entry()) {
      const middle = model.entry().start ? [(model.entry().start[0] + model.entry().end[0]) / 2, (model.entry().start[1] + model.entry().end[1]) / 2] : [0, 0];
      const [dx, dy] = ways[event.key];
      model.change(() => this.#shift(model.entry(), [dx, dy], [middle[0] + dx, middle[1] + dy]));
      plan.onSettled?.();
    } else if (ways[event.key]) plan.pan(-ways[event.key][0] * 10, -ways[event.key][1] * 10);
    else if (event.key === "r" || event.key === "R") {
      if (model.entry()) model.change(() => turned(model.entry(), event.shiftKey ? -15 : 15));
      plan.onSettled?.();
    } else if (event.key === "Delete" || event.key === "Backspace") model.remove();
    else if (event.key === "+" || event.key === "=") plan.zoom(0.8);
    else if (event.key === "-") plan.zoom(1.25);
    else if (event.key === "0") plan.fit();
    else return;
    event.preventDefault();
  }
}
