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
  constructor(episode, track) {
    this.episode = episode;
    this.track = track;
    this.holder = document.createElement("div");
    this.holder.className = "plan";
    this.moment = null;
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
      this.draw(this.moment);
    }).catch(() => { this.holder.textContent = "The plan cannot be loaded."; });
  }

  // Draws the path until a moment, and the robot.
  draw(moment) {
    this.moment = moment;
    const { track } = this;
    if (!this.layer || !moment?.pose || !track.length) return;
    const [x, y, heading] = moment.pose;
    const until = [...track.slice(0, moment.poses), moment.pose];
    const isEnd = moment.isEnd && this.episode.row.end_reason;
    const at = (radius, angle) => `${x + radius * Math.cos(heading + angle)},${y + radius * Math.sin(heading + angle)}`;
    const kind = isEnd ? this.episode.row.outcome : "driving";
    this.layer.replaceChildren(
      makeSvg("polyline", { class: "rest", points: track.map(([a, b]) => `${a},${b}`).join(" ") }),
      makeSvg("polyline", { class: "path", points: until.map(([a, b]) => `${a},${b}`).join(" ") }),
      makeSvg("circle", { class: "begin", cx: track[0][0], cy: track[0][1], r: 0.1 }),
      makeSvg("polygon", { class: `robot ${kind}`, points: [at(0.34, 0), at(0.24, 2.5), at(0.24, -2.5)].join(" ") }),
    );
  }
}
