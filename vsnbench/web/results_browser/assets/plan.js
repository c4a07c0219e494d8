// The floor plan of an episode with the driven path. Coordinates are the site's, in metres.

const SVG = "http://www.w3.org/2000/svg";
const loaded = new Map();

function makeSvg(name, attributes) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

async function planOf(episode) {
  const key = episode.site_sha256;
  if (!loaded.has(key)) {
    loaded.set(key, load(`plan/${key}.svg`).then((text) => new DOMParser().parseFromString(text, "image/svg+xml").documentElement).catch((error) => { loaded.delete(key); throw error; }));
  }
  return document.importNode(await loaded.get(key), true);
}

class Plan {
  constructor(episode) {
    this.episode = episode;
    this.holder = document.createElement("div");
    this.holder.className = "plan";
    this.step = 0;
    if (!episode.site_sha256) {
      this.holder.textContent = "The site of this episode is unknown.";
      return;
    }
    planOf(episode).then((svg) => {
      this.layer = makeSvg("g", {});
      svg.querySelector("g.plan").append(this.layer);
      for (const object of svg.querySelectorAll(".object")) {
        object.classList.toggle("goal", episode.targets.includes(object.dataset.id));
      }
      this.holder.replaceChildren(svg);
      this.draw(this.step);
    }).catch(() => { this.holder.textContent = "The plan cannot be loaded."; });
  }

  // Draws the path up to the pose before a step; the last pose is the end.
  draw(step) {
    this.step = step;
    const { path, row } = this.episode;
    if (!this.layer || !path.length) return;
    const until = path.slice(0, Math.min(step, path.length - 1) + 1);
    const [x, y, heading] = until.at(-1);
    const isEnd = step >= path.length - 1 && row.end_reason;
    const at = (radius, angle) => `${x + radius * Math.cos(heading + angle)},${y + radius * Math.sin(heading + angle)}`;
    const kind = isEnd ? row.outcome : "driving";
    this.layer.replaceChildren(
      makeSvg("polyline", { class: "rest", points: path.map(([a, b]) => `${a},${b}`).join(" ") }),
      makeSvg("polyline", { class: "path", points: until.map(([a, b]) => `${a},${b}`).join(" ") }),
      makeSvg("circle", { class: "begin", cx: path[0][0], cy: path[0][1], r: 0.1 }),
      makeSvg("polygon", { class: `robot ${kind}`, points: [at(0.34, 0), at(0.24, 2.5), at(0.24, -2.5)].join(" ") }),
    );
  }
}
