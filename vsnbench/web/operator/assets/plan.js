// The floor plan with the mark, the route to it, and the robot. Coordinates are the site's, in metres.

const SVG = "http://www.w3.org/2000/svg";
let plan = null;

export async function loadPlan(holder) {
  if (plan) return plan;
  const answer = await fetch("/plan.svg");
  if (!answer.ok) throw new Error("no plan");
  const root = new DOMParser().parseFromString(await answer.text(), "image/svg+xml").documentElement;
  const svg = document.importNode(root, true);
  const layer = make("g", {});
  svg.querySelector("g.plan").append(layer); // throws if the answer is not our plan
  holder.replaceChildren(svg);
  plan = { svg, layer };
  return plan;
}

function make(name, attributes, text = "") {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
}

function arrow([x, y, heading], length, width) {
  const at = (radius, angle) => `${x + radius * Math.cos(heading + angle)},${y + radius * Math.sin(heading + angle)}`;
  return [at(length, 0), at(width, 2.5), at(width, -2.5)].join(" ");
}

// Draws the state on the plan, and returns a caption.
export function drawState(plan, state) {
  const { svg, layer } = plan;
  const trial = state.trial;
  for (const object of svg.querySelectorAll(".object")) {
    object.classList.toggle("goal", !!trial && trial.targets.includes(object.dataset.id));
  }
  for (const place of svg.querySelectorAll(".goal-place")) {
    place.classList.toggle("goal", !!trial && place.dataset.id.split(" ")[0] === trial.goal);
  }
  const parts = [];
  const isPlacing = state.question && ["begin", "place"].includes(state.question.kind);
  if (isPlacing && state.route.length) parts.push(make("polyline", { class: "route", points: pointList(state.route) }));
  if (isPlacing && state.left_at) {
    parts.push(make("circle", { class: "left-at", cx: state.left_at[0], cy: state.left_at[1], r: 0.17 }));
  }
  if (trial) {
    const [x, y, heading] = trial.pose;
    parts.push(make("circle", { class: "mark-halo", cx: x, cy: y, r: 0.45 }));
    parts.push(make("polygon", { class: "mark", points: arrow([x, y, heading], 0.62, 0.2) }));
    parts.push(make("circle", { class: "mark", cx: x, cy: y, r: 0.24 }));
    parts.push(make("text", { class: "mark-number", transform: `translate(${x} ${y - 0.1}) scale(1 -1)` }, String(trial.start)));
  }
  if (isPlacing && state.placing.pose) {
    parts.push(make("polygon", { class: "measured-pose", points: arrow(state.placing.pose, 0.4, 0.24) }));
  }
  if (state.path.length) {
    parts.push(make("polyline", { class: "path", points: pointList([trial ? trial.pose : state.path[0], ...state.path]) }));
    parts.push(make("polygon", { class: "robot", points: arrow(state.path.at(-1), 0.3, 0.22) }));
  }
  layer.replaceChildren(...parts);
  if (!trial) return "";
  const [left, top, width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
  const [x, y] = trial.pose;
  if (x < left || x > left + width || -y < top || -y > top + height) {
    return `Mark ${trial.start} is outside this plan, at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m.`;
  }
  if (!isPlacing || !state.left_at) return "";
  return state.route.length
    ? `Dashed: the shortest route from the robot's last position, ${lengthOf(state.route).toFixed(1)} m.`
    : "There is no free route from the robot's last position to this mark. Carry the robot.";
}

const pointList = (points) => points.map(([x, y]) => `${x},${y}`).join(" ");

function lengthOf(points) {
  return points.slice(1).reduce((sum, [x, y], i) => sum + Math.hypot(x - points[i][0], y - points[i][1]), 0);
}
