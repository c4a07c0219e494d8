// The floor plan with the mark, the way there, and the robot; x and y are the site's own, metres.

const SVG = "http://www.w3.org/2000/svg";
let drawn = null;

export async function drawPlan(holder) {
  if (drawn) return drawn;
  const answer = await fetch("/plan.svg");
  if (!answer.ok) throw new Error("no plan");
  const whole = new DOMParser().parseFromString(await answer.text(), "image/svg+xml").documentElement;
  const svg = document.importNode(whole, true);
  const layer = make("g", {});
  svg.querySelector("g.plan").append(layer); // an answer that is no plan of ours has none
  holder.replaceChildren(svg);
  drawn = { svg, layer };
  return drawn;
}

function make(name, attributes, text = "") {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
}

function arrow([x, y, heading], far, wide) {
  const at = (r, off) => `${x + r * Math.cos(heading + off)},${y + r * Math.sin(heading + off)}`;
  return [at(far, 0), at(wide, 2.5), at(wide, -2.5)].join(" ");
}

export function showOnPlan(plan, state) {
  const { svg, layer } = plan;
  const trial = state.trial;
  for (const thing of svg.querySelectorAll(".thing")) {
    thing.classList.toggle("goal", !!trial && thing.querySelector("title")?.textContent === trial.goal);
  }
  const parts = [];
  const placing = state.question && ["begin", "place"].includes(state.question.asks);
  if (placing && state.way.length) {
    parts.push(make("polyline", { class: "way", points: state.way.map(([x, y]) => `${x},${y}`).join(" ") }));
  }
  if (placing && state.left_at) {
    parts.push(make("circle", { class: "left", cx: state.left_at[0], cy: state.left_at[1], r: 0.17 }));
  }
  if (trial) {
    const [x, y, heading] = trial.pose;
    parts.push(make("circle", { class: "mark-halo", cx: x, cy: y, r: 0.45 }));
    parts.push(make("polygon", { class: "mark", points: arrow([x, y, heading], 0.62, 0.2) }));
    parts.push(make("circle", { class: "mark", cx: x, cy: y, r: 0.24 }));
    parts.push(make("text", { class: "mark-number", transform: `translate(${x} ${y - 0.1}) scale(1 -1)` }, String(trial.start)));
  }
  if (placing && state.placing.stands) {
    parts.push(make("polygon", { class: "stands", points: arrow(state.placing.stands, 0.4, 0.24) }));
  }
  if (state.course.length) {
    const points = [trial ? trial.pose : state.course[0], ...state.course].map(([x, y]) => `${x},${y}`).join(" ");
    parts.push(make("polyline", { class: "course", points }));
    parts.push(make("polygon", { class: "robot", points: arrow(state.course.at(-1), 0.3, 0.22) }));
  }
  layer.replaceChildren(...parts);
  if (!trial) return "";
  const [left, top, width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
  const [x, y] = trial.pose;
  if (x < left || x > left + width || -y < top || -y > top + height) {
    return `The site's plan does not show mark ${trial.start}: it lies outside, at x ${x.toFixed(2)} m, y ${y.toFixed(2)} m.`;
  }
  if (!placing || !state.left_at) return "";
  return state.way.length
    ? `Dashed: the shortest way from where the robot was left, ${lengthOf(state.way).toFixed(1)} m.`
    : "No way through the free floor leads from where the robot was left to this mark: carry it.";
}

function lengthOf(points) {
  return points.slice(1).reduce((sum, [x, y], i) => sum + Math.hypot(x - points[i][0], y - points[i][1]), 0);
}
