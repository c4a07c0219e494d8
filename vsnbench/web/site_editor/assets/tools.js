// Pointer and keyboard input on the plan: select, draw, drag, turn, pan and pinch.

import { SIZES, distance, fitBox, move, radians, rotate, rounded } from "./model.js";
import { GRID_M } from "./snapping.js";

export const TOOLS = [
  ["select", "Select", "Click an element to select it, drag it to move it. Drag the background to pan."],
  ["wall", "Wall", "Click both ends, or drag. Type a length and press Enter to set it. Escape ends. Hold Alt to draw without snapping."],
  ["room", "Room", "Click the corners in order. Enter or a click on the first corner closes the room. Hold Alt to draw without snapping."],
  ["door", "Door", "Click a wall to add a door of 0.80 m."],
  ["window", "Window", "Click a wall to add a window of 1.20 m."],
  ["start", "Start", "Click the starting position. Drag before releasing to set the heading."],
];

const GOAL_TOOLS = {
  target: "Click objects to make them targets of the goal, or not. Click starts to limit the goal to them. Escape ends.",
  region: "Click the corners of the region in order. Enter or a click on the first corner closes it. Hold Alt to draw without snapping.",
  point: "Click the point.",
  camera: "Click the camera's position. Drag before releasing to set its heading.",
  way: "Click the points of the way in order. Enter or a click on the last point ends it, and photographs are taken along it.",
};
const FINGER_PX = 10;
const DRAWN_PX = 20;

export class Tools {
  constructor(plan, model, showHint) {
    Object.assign(this, { plan, model, showHint, tool: "select", typed: "", free: false, pointers: new Map(), drag: null, tap: null, draft: [] });
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
    this.byKeys = false;
    this.#end();
    this.onUse?.(tool);
    const text = TOOLS.find(([name]) => name === tool)?.[2] ?? GOAL_TOOLS[tool] ?? `Click the position of the ${tool.replaceAll("_", " ")}.`;
    this.showHint(text);
  }

  // Whether the tool draws or chooses something of the selected goal.
  get isForGoal() { return this.tool in GOAL_TOOLS; }

  // For keyboard users: adds the tool's element in the middle of the view.
  addInView() {
    const at = this.model.snapped(this.plan.centre());
    if (this.tool === "wall") this.model.add("walls", { start: at, end: [rounded(at[0] + 2), at[1]] });
    else if (this.tool === "room") this.model.add("rooms", { name: this.model.newName("rooms", "room"), polygon: [at, [at[0] + 3, at[1]], [at[0] + 3, at[1] + 3], [at[0], at[1] + 3]] });
    else if (this.tool === "region") this.#drawn({ region: [at, [at[0] + 1, at[1]], [at[0] + 1, at[1] + 1], [at[0], at[1] + 1]].map((point) => point.map((each) => rounded(each))) });
    else if (this.tool === "point") this.#drawn({ point: at });
    else if (this.tool === "way") { this.byKeys = true; this.#wayPoint(this.plan.centre()); }
    else if (this.tool !== "select" && !this.isForGoal) this.#add(at);
  }

  #drawn(target) {
    this.use("select");
    this.onTargetDrawn(target);
  }

  #down(event) {
    const { plan, model } = this;
    plan.svg.setPointerCapture(event.pointerId);
    if (document.activeElement !== plan.svg) document.activeElement?.blur(); // applies a value that was just typed
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.pointers.size > 1) { this.drag = this.tap = null; return; }
    const { target, shiftKey, clientX, clientY } = event;
    this.free = event.altKey;
    this.tap = { at: plan.at(event), target, shiftKey, from: [clientX, clientY], isPending: false };
    // A finger can be the first of a pinch, so its action waits until it moves alone or is lifted.
    const adds = plan.onPoint || this.tool !== "select" || target.dataset?.of?.startsWith("lines");
    if (event.pointerType === "touch" && adds) this.tap.isPending = true;
    else this.#press();
  }

  #press() {
    const { plan, model } = this;
    const { at, target, shiftKey } = this.tap;
    this.tap.isPending = false;
    const handle = target.dataset?.handle;
    const of = target.dataset?.of?.split(" ");
    if (plan.onPoint) { plan.onPoint(at); return; }
    if (of?.[0] === "lines" && this.tool === "select") { plan.onLine(Number(of[1]), shiftKey); return; }
    // Before the handles of the selected element: a new room can start at a corner of the previous one.
    if (this.tool === "wall") { this.#corner(at); return; }
    if (this.tool === "room" || this.tool === "region") { this.#roomCorner(at); return; }
    if (this.tool === "way") { this.byKeys = false; this.#wayPoint(at); return; }
    if (this.tool === "target") { this.onTarget(of); return; }
    if (this.tool === "point") { this.#drawn({ point: at.map((each) => rounded(each, 0.01)) }); return; }
    if (this.tool === "camera") {
      this.drag = { kind: "camera", from: at };
      this.onCamera({ x_m: rounded(at[0], 0.01), y_m: rounded(at[1], 0.01) });
      return;
    }
    if (handle && model.entry()) { this.drag = { kind: "handle", handle, group: Symbol(handle) }; return; }
    if (this.tool !== "select") { this.#add(at); return; }
    if (of) {
      model.select([of[0], ...of.slice(1).map(Number)]);
      this.drag = { kind: "move", from: at, group: Symbol("move") };
    } else {
      model.select(null);
      this.drag = { kind: "pan", from: at };
    }
  }

  #move(event) {
    const { plan, model } = this;
    const before = this.pointers.get(event.pointerId);
    if (before && this.pointers.size === 2) { this.#pinch(event, before); return; }
    const at = plan.at(event);
    this.free = event.altKey;
    if (before && this.tap?.isPending && distance(this.tap.from, [event.clientX, event.clientY]) > FINGER_PX) this.#press();
    if (this.draft.length && !this.tap?.isPending) {
      plan.draft = [...this.draft, this.#next(at)];
      plan.draw();
      return;
    }
    if (!before || !this.drag) return;
    if (this.drag.kind === "pan") { plan.pan(at[0] - this.drag.from[0], at[1] - this.drag.from[1]); return; }
    if (this.drag.kind === "camera") {
      const { from } = this.drag;
      if (distance(from, at) > 0.1) this.onCamera({ heading_deg: rounded((Math.atan2(at[1] - from[1], at[0] - from[0]) * 180) / Math.PI, 1) });
      return;
    }
    if (this.drag.kind === "move") {
      const step = [at[0] - this.drag.from[0], at[1] - this.drag.from[1]].map((each) => rounded(each, event.altKey ? 0.01 : 0.05));
      if (step[0] || step[1]) {
        model.change(() => this.#shift(model.entry(), step, at), this.drag.group);
        this.drag.from = [this.drag.from[0] + step[0], this.drag.from[1] + step[1]];
      }
      return;
    }
    model.change(() => this.#dragHandle(model.entry(), at), this.drag.group);
  }

  #shift(entry, step, at) {
    const list = this.model.selected[0];
    if (list === "doors" || list === "windows") {
      const found = this.model.opening(at, distance(entry.start, entry.end), this.free);
      if (found) Object.assign(entry, found);
    } else move(entry, step[0], step[1]);
  }

  #dragHandle(entry, at) {
    const { handle } = this.drag;
    const list = this.model.selected[0];
    if (handle === "turn") {
      const turn = (Math.atan2(at[1] - entry.position[1], at[0] - entry.position[0]) * 180) / Math.PI;
      rotate(entry, rounded(turn, 5) - (entry.heading_deg ?? 0));
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
      entry[field][Number(index)] = this.model.snapped(at, { but: { entry, index: Number(index) }, free: this.free, ...(field === "footprint" ? { reach: 0 } : {}) });
      fitBox(entry);
    } else if (list === "walls") {
      const other = handle === "start" ? entry.end : entry.start;
      entry[handle] = this.model.snapped(at, { from: other, but: { entry }, free: this.free });
    } else {
      entry[handle] = this.model.onWall(at, this.free) ?? entry[handle];
    }
  }

  #up(event) {
    this.pointers.delete(event.pointerId);
    const { tap } = this;
    this.free = event.altKey;
    this.tap = null;
    if (tap && event.type === "pointerup") {
      if (tap.isPending) { this.tap = tap; this.#press(); this.tap = null; }
      else if (this.draft.length && distance(tap.from, [event.clientX, event.clientY]) > DRAWN_PX) this.#finishDrag(this.plan.at(event));
    }
    if (this.drag?.kind !== "pan") this.plan.onSettled?.();
    this.drag = null;
  }

  // Ends a dragged wall, or edge of a room, at the pointer.
  #finishDrag(at) {
    if (this.tool === "wall") this.#corner(at);
    else if (this.tool === "way") this.#wayPoint(at);
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

  // Adds a point to a way, or ends the way at its last point.
  #wayPoint(at) {
    const point = at.map((each) => rounded(each, 0.01));
    const last = this.draft.at(-1);
    if (last && distance(last, point) < Math.max(0.02, this.byKeys ? 0 : this.plan.reach * this.plan.unit())) { this.#endWay(); return; }
    this.draft.push(point);
    this.plan.draft = [...this.draft];
    this.plan.draw();
  }

  #endWay() {
    const way = this.draft;
    if (way.length < 2) return;
    this.use("select");
    this.onWayDrawn(way);
  }

  // Snaps the next point of the drawing, also to the first corner of a room that it can close.
  #next(at) {
    if (this.tool === "way") return at.map((each) => rounded(each, 0.01));
    const meet = this.tool !== "wall" && this.draft.length > 2 ? [this.draft[0]] : [];
    return this.model.snapped(at, { from: this.draft.at(-1) ?? null, meet, free: this.free });
  }

  #corner(at) {
    const point = this.#next(at);
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
    const point = this.#next(at);
    if (this.draft.length > 2 && distance(point, this.draft[0]) < 0.02) { this.#closeRoom(); return; }
    this.draft.push(point);
    this.plan.draft = [...this.draft];
    this.plan.draw();
  }

  #closeRoom() {
    const polygon = this.draft;
    if (this.tool === "region") { this.#drawn({ region: polygon }); return; }
    this.#end();
    if (polygon.length > 2) this.model.add("rooms", { name: this.model.newName("rooms", "room"), polygon });
  }

  #add(at) {
    const { model, tool } = this;
    if (tool === "door" || tool === "window") {
      const found = model.opening(at, tool === "door" ? 0.8 : 1.2, this.free);
      if (!found) { this.showHint(`Click closer to a wall to add a ${tool}.`); return; }
      if (tool === "door") model.add("doors", { name: model.newName("doors", "door"), ...found });
      else model.add("windows", found);
      return;
    }
    const position = at.map((each) => rounded(each, this.free ? undefined : GRID_M));
    if (tool === "start") {
      model.add("starts", { number: model.newNumber(), position, heading_deg: 0 });
      this.drag = { kind: "handle", handle: "turn", group: Symbol("turn") };
      return;
    }
    model.add("objects", { id: model.newId(tool), category: tool, position, heading_deg: 0, size_m: [...SIZES[tool]], ...(tool === "rug" ? { solid: false } : {}) });
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
      this.showHint(`Length: ${this.typed} m. Press Enter to set it in the direction of the pointer.`);
    } else if (event.key === "Enter" && this.tool === "way" && this.draft.length && !this.typed) {
      if (this.byKeys) this.#wayPoint(plan.centre());
      else this.#endWay();
    } else if (event.key === "Enter" && this.tool !== "wall" && this.tool !== "way" && this.draft.length > 2) this.#closeRoom();
    else if (event.key === "Enter" && this.draft.length && Number(this.typed) > 0 && plan.draft?.length > 1) {
      const [from, to] = plan.draft.slice(-2);
      const share = Number(this.typed) / (distance(from, to) || 1);
      const end = [rounded(from[0] + (to[0] - from[0]) * share), rounded(from[1] + (to[1] - from[1]) * share)];
      this.typed = "";
      if (this.tool === "wall") { model.add("walls", { start: from, end }); this.draft = [end]; } else this.draft.push(end);
      plan.draft = [...this.draft];
      plan.draw();
    } else if (event.key === "Enter" && this.tool !== "select" && !this.draft.length) this.addInView();
    else if (event.key === "Escape" && this.isForGoal) this.use("select");
    else if (event.key === "Escape") { this.#end(); model.select(null); }
    else if (ways[event.key] && model.entry() && !model.entry().kind) {
      this.free = true; // key steps have a fixed length
      const middle = model.entry().start ? [(model.entry().start[0] + model.entry().end[0]) / 2, (model.entry().start[1] + model.entry().end[1]) / 2] : [0, 0];
      const [dx, dy] = ways[event.key];
      model.change(() => this.#shift(model.entry(), [dx, dy], [middle[0] + dx, middle[1] + dy]));
      plan.onSettled?.();
    } else if (ways[event.key]) {
      plan.pan(-ways[event.key][0] * 10, -ways[event.key][1] * 10);
      if (this.byKeys) {
        plan.draft = [...this.draft, plan.centre()];
        plan.draw();
      }
    }
    else if (event.key === "r" || event.key === "R") {
      if (model.entry()) model.change(() => rotate(model.entry(), event.shiftKey ? -15 : 15));
      plan.onSettled?.();
    } else if (event.key === "Delete" || event.key === "Backspace") model.remove();
    else if (event.key === "+" || event.key === "=") plan.zoom(0.8);
    else if (event.key === "-") plan.zoom(1.25);
    else if (event.key === "0") plan.fit();
    else return;
    event.preventDefault();
  }
}
