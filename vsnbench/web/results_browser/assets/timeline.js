// What a player shows at each moment of an episode: one per step, or the images of a film on the robot's clock.
//
// A moment has `at`, its place on the axis: seconds since the first image where a film is shown, else the number of steps
// before it. `seen` is the step whose model got the image of the moment, -1 for an image of the film. `driven` is the step
// that the robot takes then, -1 before the first answer: on a robot that drives on, an answer before the one to the image.

const MARGIN_S = 0.002; // times are rounded

// Whether an episode can be shown on the robot's clock.
function hasClock(episode) {
  return episode.steps.length > 0 && episode.steps.every((step) => step.time_s !== null && step.until_s !== null);
}

// Whether episodes that are shown together are played in time: one has a film, and all have times.
function playsInTime(episodes) {
  return episodes.every(hasClock) && episodes.some((episode) => episode.steps.some((step) => step.film.length));
}

// The moments of an episode by steps, before each step and the end, and the poses of its path.
function momentsOfSteps({ steps, path }) {
  const shown = [...steps.map((step, k) => ({ at: k, seen: k, driven: k, image: imageOf(step) }))];
  shown.push({ ...(shown.at(-1) ?? { seen: -1, driven: -1, image: null }), at: steps.length, isEnd: true });
  return { track: path, moments: shown.map((moment) => ({ ...moment, poses: moment.at, pose: path[Math.min(moment.at, path.length - 1)] })) };
}

// The moments of an episode in time, each image and the end, and the poses of its path and its film.
function momentsInTime({ steps, path }) {
  const first = steps[0].time_s;
  const effects = steps.map((step) => step.time_s + (step.age_s ?? 0) - MARGIN_S);
  const known = [[first, path[0]], ...steps.flatMap((step, k) => [
    ...step.film.map(([time, ...pose]) => [time, pose.slice(0, 3)]), [step.until_s, path[k + 1]]])].filter(([, pose]) => pose);
  known.sort((a, b) => a[0] - b[0]);
  const shown = steps.flatMap((step, k) => [{ time: step.time_s, seen: k, image: imageOf(step), pose: step.pose },
    ...step.film.map(([time, x, y, heading, ...sent], i) => ({ time, seen: -1, image: `${step.number}-${i + 1}`, pose: [x, y, heading], sent }))]);
  shown.sort((a, b) => a.time - b.time);
  shown.push({ ...shown.at(-1), time: Math.max(steps.at(-1).until_s, shown.at(-1).time), seen: -1, sent: [], pose: path.at(-1), isEnd: true });
  const moments = shown.map((moment) => ({ ...moment, at: moment.time - first,
    driven: effects.findLastIndex((effect) => effect <= moment.time), poses: known.filter(([time]) => time <= moment.time).length }));
  return { moments, track: known.map(([, pose]) => pose) };
}

const imageOf = (step) => (step.has_image ? String(step.number) : null);

// Times of an answer while the robot waits at rest: before the first one took effect, and at the end of each path.
function waitsOf({ steps }) {
  const first = steps[0]?.time_s ?? 0;
  return steps.flatMap((step, k) => {
    const before = k === 0 ? Math.min(step.age_s ?? 0, step.waiting_s ?? 0) : 0;
    const after = (step.waiting_s ?? 0) - before;
    return [[step.time_s, step.time_s + before], [step.until_s - after, step.until_s]]
      .filter(([from, to]) => to - from > MARGIN_S).map(([from, to]) => [from - first, to - first]);
  });
}

// The strip under the slider: where the robot waits, where an answer was dropped or its path blocked.
class Timeline {
  constructor(episode, end) {
    this.waits = waitsOf(episode);
    const first = episode.steps[0].time_s;
    const lasted = episode.steps.at(-1).until_s - first;
    const at = (kind) => episode.steps.filter((step) => step[kind]).map((step) => step.time_s + (step.age_s ?? 0) - first);
    const waited = this.waits.reduce((sum, [from, to]) => sum + to - from, 0);
    const [stale, blocked] = [at("stale"), at("blocked")];
    const counts = [
      ["wait", waited > 0.05 && `waits ${waited.toFixed(1)} s`],
      ["stale", stale.length && `${stale.length} stale ${stale.length === 1 ? "answer" : "answers"} dropped`],
      ["blocked", blocked.length && `${blocked.length} blocked`],
    ].filter(([, text]) => text);
    const share = (seconds) => (100 * seconds) / end;
    const box = (kind, from, to) => makeSvg("rect", { class: kind, x: share(from), width: Math.max(share(to - from), 0.25), y: 0, height: 8 });
    const strip = makeSvg("svg", { viewBox: "0 0 100 8", preserveAspectRatio: "none", "aria-hidden": "true" });
    strip.append(box("drive", 0, lasted), ...this.waits.map(([from, to]) => box("wait", from, to)),
      ...blocked.map((time) => box("blocked", time, time)), ...stale.map((time) => box("stale", time, time)));
    this.element = make("div", { class: "timeline" }, strip, make("p", { class: "small dim" }, `#${episode.row.id}: ${lasted.toFixed(1)} s`,
      ...counts.map(([kind, text]) => make("span", { class: `key ${kind}` }, text))));
  }

  // Whether the robot waits for an answer at a time.
  waitsAt(at) {
    return this.waits.some(([from, to]) => from <= at + MARGIN_S && at < to - MARGIN_S);
  }
}
