// One episode, or up to four side by side, step by step, or in time where there is a film.

const PLAY_MS = 250;
const PRELOADED = 6;
const PRELOADED_FILM = 20;
const SCORES = 6;
const FOLDED = 3; // events of a kind that become one line

// Camera, plan, action and scores of one episode at a moment.
class Player {
  constructor(episode, inTime, color) {
    this.episode = episode;
    this.inTime = inTime;
    const { moments, track } = inTime ? momentsInTime(episode) : momentsOfSteps(episode);
    this.moments = moments;
    this.plan = new Plan(episode, track);
    this.image = make("img", { alt: "", class: "camera" });
    this.none = make("p", { class: "dim none", hidden: true }, "No image of this step.");
    const roles = new Set(episode.row.has_images && hasFurther ? episode.steps.flatMap((step) => step.cameras ?? []) : []);
    this.views = new Map([...roles].map((role) => [role, { image: make("img", { alt: "" }), caption: make("figcaption", { class: "small" }) }]));
    this.other = make("figcaption", { class: "dim small", hidden: true });
    this.action = make("p", { class: "action" });
    this.scores = make("div", { class: "scores" });
    this.banner = make("p", { class: "banner" });
    const { row } = episode;
    this.chip = outcomeChip(row);
    this.element = make("article", { class: "player", "aria-label": `episode ${row.id}` },
      make("h2", {}, make("a", { href: `#/episode/${row.id}` }, `#${row.id}`), " ", swatch(color), `${row.condition} `,
        make("span", { class: "dim small" }, `${row.goal} from start ${row.start}${row.repetition > 1 ? ` (${row.repetition})` : ""}`)),
      make("div", { class: "stage" }, make("div", { class: "cameras" }, make("figure", {}, this.image, this.none, this.other), this.furtherCameras()), this.plan.holder,
        make("div", { class: "side" }, this.chip, this.result(), this.banner, this.action, this.scores)));
    this.image.addEventListener("error", () => { this.image.hidden = true; this.none.hidden = false; });
  }

  get last() {
    return this.moments.at(-1).at;
  }

  // Pictures of the further cameras, by role.
  furtherCameras() {
    return this.views.size ? make("div", { class: "views" }, ...[...this.views.values()].map(({ image, caption }) => make("figure", {}, caption, image))) : "";
  }

  // Where the episode ended, and what it took.
  result() {
    const { row, stopped, facts = {} } = this.episode;
    const lines = [["to the goal", metres(row.distance_m)], ["actions", String(row.actions)],
      ["path", row.path_m === null ? "" : metres(row.path_m)], ["shortest", metres(row.shortest_m)], ["goal", facts["goal text"]], ["stopped", stopped]];
    return factList(lines);
  }

  // Adds the strip of the times at which the robot waits, and of dropped and blocked answers, on an axis of `end` seconds.
  addTimeline(end) {
    this.timeline = new Timeline(this.episode, end);
    return this.timeline.element;
  }

  show(at) {
    const { steps, row } = this.episode;
    const place = this.moments.findLastIndex((each) => each.at <= at);
    const moment = this.moments[place];
    this.plan.draw(moment);
    const step = steps[moment.driven] ?? null;
    const seen = steps[moment.seen] ?? null;
    this.banner.className = `banner ${moment.isEnd ? row.outcome : this.inTime && this.timeline.waitsAt(at) ? "waits" : "driving"}`;
    this.banner.textContent = moment.isEnd ? this.verdict() : this.inTime ? this.stateInTime(moment, at) : this.stateAtStep(step);
    this.chip.hidden = moment.isEnd && row.outcome === "success"; // the banner says it; a failure's chip has its cause
    this.showImage(moment, place);
    if (!step) { this.action.replaceChildren(); this.scores.replaceChildren(); return; }
    const notes = [step.stale && "not driven: the robot keeps the path before it", step.blocked && "blocked by the depth guard", step.refusal, step.touched && `collision: ${step.touched}`, step.failure]
      .filter(Boolean);
    const raw = step.raw_action && step.raw_action !== step.action ? ` (${step.raw_action})` : "";
    const byStack = this.episode.execution === "stack"; // which is watched, and answers nothing but STOP
    this.action.replaceChildren(byStack && step.action !== "STOP" ? "" : make("strong", {}, `${step.action.replaceAll("_", " ").toLowerCase()}${raw}`),
      ...notes.map((text) => make("span", { class: "warn" }, ` ${text}`)),
      byStack || step.infer_s === null ? "" : make("span", { class: "dim small" }, ` decided in ${(step.infer_s * 1000).toFixed(0)} ms`),
      byStack || step.age_s === null || step.stale ? "" : make("span", { class: "dim small" }, `, took effect ${step.age_s.toFixed(2)} s after its image`),
      moment.sent?.length ? make("span", { class: "small" }, ` commanded ${velocityText(moment.sent)}`) : "",
      this.inTime && seen && !moment.isEnd && this.episode.execution === "continuous"
        ? make("span", { class: "small" }, ` · this is the image of answer ${seen.number}`) : "");
    const scores = Object.entries(step.scores).sort((a, b) => b[1] - a[1]).slice(0, SCORES);
    this.scores.replaceChildren(...scores.map(([name, score]) => {
      const bar = make("div", { class: "score" }, make("span", {}, name.replaceAll("_", " ").toLowerCase()), make("span", {}, score.toFixed(2)));
      bar.style.setProperty("--share", `${Math.max(0, Math.min(1, score)) * 100}%`);
      return bar;
    }), ...Object.entries(step.values).map(([name, value]) => make("div", { class: "detail small" }, `${name}: ${value}`)),
    step.note ? make("p", { class: "small" }, step.note) : "");
  }

  verdict() {
    const { row } = this.episode;
    const verdict = this.episode.verdicts.filter((given) => !given.proposed).at(-1);
    return `${MARKS[row.outcome]} ${verdict ? verdict.reason : resultText(row)}`;
  }

  stateAtStep({ number, time_s }) {
    const { execution, max_actions, steps } = this.episode;
    const count = execution === "stop_and_go" ? `action ${number} of at most ${max_actions ?? "?"}` : `answer ${number} of ${steps.length}`;
    return `${count}${time_s === null ? "" : `, ${time_s.toFixed(1)} s`}`;
  }

  // What the robot does at a moment of a film.
  stateInTime({ driven }, at) {
    const { steps, execution } = this.episode;
    const time = `${at.toFixed(1)} s`;
    if (execution === "stack") return `driven by the stack, ${time}`;
    if (driven < 0) return `waits for the first answer, ${time}`;
    const step = steps[driven];
    if (execution !== "continuous") return `action ${step.number}, ${time}`;
    const stale = step.stale ? `: stale, dropped when ${step.age_s.toFixed(2)} s old` : "";
    return `answer ${step.number} of ${steps.length}, ${time}${stale}${this.timeline.waitsAt(at) ? " · waits for the next answer" : ""}`;
  }

  showImage(moment, place) {
    const { row } = this.episode;
    this.showFurther(moment, place);
    this.image.hidden = moment.image === null || !row.has_images;
    this.none.hidden = !this.image.hidden;
    if (this.image.hidden) return;
    const { address, name } = pictureOf(row.id, moment.image);
    this.other.hidden = name === moment.image;
    this.other.textContent = `picture of action ${name}: the file has every ${every}.`;
    if (this.image.getAttribute("src") !== address) this.image.src = address;
    this.image.alt = this.inTime ? `camera at ${moment.at.toFixed(1)} s` : `camera before action ${moment.seen + 1}`;
    const next = this.moments.slice(place + 1, place + (this.inTime ? PRELOADED_FILM : PRELOADED));
    for (const { image } of next) if (image !== null && !isSingle) new Image().src = pictureOf(row.id, image).address;
  }

  // The further cameras have an image per step: between them the last one stays, with its time.
  showFurther(moment, place) {
    const latest = this.moments.slice(0, place + 1).findLast(({ seen }) => seen >= 0);
    const step = this.episode.steps[latest?.seen];
    for (const [role, { image, caption }] of this.views) {
      image.hidden = !step?.cameras?.includes(role);
      caption.textContent = image.hidden ? `${role}: no image of this step` : latest.at < moment.at && !moment.isEnd ? `${role} at ${latest.at.toFixed(1)} s` : role;
      if (image.hidden) continue;
      const { address } = pictureOf(this.episode.row.id, `${step.number}-${role}`);
      if (image.getAttribute("src") !== address) image.src = address;
      image.alt = `${role} camera before action ${step.number}`;
    }
  }
}

// A velocity in words: ahead and to the left in m/s, turn in rad/s.
function velocityText([ahead, left, turn]) {
  const aside = left ? `, ${left.toFixed(2)} m/s to the left` : "";
  return `${ahead.toFixed(2)} m/s${aside}, ${(turn * 180 / Math.PI).toFixed(0)}°/s`;
}

const factList = (lines) => make("dl", { class: "facts" }, ...lines.filter(([, text]) => text).flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)]));

// Events by kind, those of a frequent kind as one entry: its time, words, author, and the single events.
function foldedEvents(events) {
  return [...grouped(events, (event) => (event.is_note ? `${event.at} ${event.text}` : event.kind)).values()].flatMap((same) => {
    const words = (event) => `${event.kind.replaceAll("_", " ")}${event.step ? ` at action ${event.step}` : ""}: ${event.text}`;
    if (same.length < FOLDED) return same.map((event) => ({ at: event.at, text: words(event), who: event.author, parts: [] }));
    const [first] = same;
    return [{ at: first.at, text: `${first.kind.replaceAll("_", " ")} ${same.length} times${mostly(same)}`, who: first.author, parts: same.map(words) }];
  });
}

// What most events of a kind have in common: their distance, or else their words.
function mostly(events) {
  const frequent = (texts) => [...grouped(texts, (text) => text)].sort((a, b) => b[1].length - a[1].length)[0];
  const distances = events.map(({ text }) => text.match(/\d+(?:\.\d+)? m\b/)?.[0]).filter(Boolean);
  const isDistance = distances.length > events.length / 2;
  const [text, same] = frequent(isDistance ? distances : events.map((event) => event.text));
  return `${same.length === events.length ? "," : ", mostly"}${isDistance ? " at" : ":"} ${text}`;
}

const sorted = (numbers) => [...new Set(numbers)].sort((a, b) => a - b);

class EpisodePage {
  constructor(numbers, rows, onAnnotated, colors) {
    this.colors = colors;
    this.numbers = numbers;
    this.rows = rows;
    this.onAnnotated = onAnnotated;
    this.element = make("div", { class: "episode" });
    this.timer = null;
    this.place = 0;
  }

  async open(place) {
    const episodes = await Promise.all(this.numbers.map((number) => load(`data/episode-${number}.json`)));
    for (const episode of episodes) {
      const listed = this.rows.find((row) => row.id === episode.row.id);
      episode.row = { ...titled(episode.row), failure: listed?.failure ?? "" };
    }
    this.episodes = episodes;
    this.inTime = playsInTime(episodes);
    this.players = episodes.map((episode) => new Player(episode, this.inTime, this.colors.get(episode.row.condition)));
    this.last = Math.max(...this.players.map((player) => player.last));
    const moments = this.players.flatMap((player) => player.moments);
    this.times = sorted(moments.map(({ at }) => at));
    this.stops = this.inTime ? sorted([...moments.filter(({ seen }) => seen >= 0).map(({ at }) => at), this.last]) : this.times;
    this.slider = make("input", { type: "range", min: "0", max: String(this.last), step: this.inTime ? "any" : "1",
      "aria-label": this.inTime ? "time" : "step", id: "slider", oninput: () => this.show(Number(this.slider.value)) });
    this.playButton = make("button", { class: "chip", id: "play", onclick: () => this.toggle() }, "▶ play");
    this.where = make("span", { class: "dim", role: "status" });
    const bar = make("div", { class: "transport" },
      make("button", { class: "chip", "aria-label": "previous step", onclick: () => this.step(-1) }, "←"), this.playButton,
      make("button", { class: "chip", "aria-label": "next step", onclick: () => this.step(1) }, "→"),
      make("div", { class: "axis" }, this.slider, ...(this.inTime ? this.players.map((player) => player.addTimeline(this.last)) : [])), this.where);
    this.element.replaceChildren(this.links(), make("div", { class: `players ${["", "", "two", "two many", "two many"][this.players.length]}` },
      ...this.players.map((player) => player.element)), bar, ...episodes.map((episode) => this.facts(episode)));
    this.show(Math.min(place ?? 0, this.last));
  }

  close() {
    clearTimeout(this.timer);
  }

  show(place) {
    this.place = Math.min(Math.max(place, 0), this.last);
    this.slider.value = String(this.place);
    for (const player of this.players) player.show(this.place);
    const isEnd = this.place === this.last;
    this.where.textContent = this.inTime ? `${isEnd ? "end" : this.place.toFixed(1)} of ${this.last.toFixed(1)} s`
      : isEnd ? `end (${this.last} steps)` : `step ${this.place + 1} of ${this.last}`;
    this.slider.setAttribute("aria-valuetext", this.where.textContent);
    if (isEnd) this.pause();
  }

  // Goes to the previous or next step; in a film, to the time of its image.
  step(by) {
    const next = by < 0 ? this.stops.findLast((at) => at < this.place - MARGIN_S) : this.stops.find((at) => at > this.place + MARGIN_S);
    if (next !== undefined) this.show(next);
    if (this.timer) { this.pause(); this.play(); }
  }

  toggle() {
    if (this.timer) { this.pause(); return; }
    if (this.place === this.last) this.show(0);
    this.play();
  }

  // Plays the steps at a constant rate, or the images of a film at the times at which they were taken.
  play() {
    const [from, began] = [this.place, performance.now()];
    this.playButton.textContent = "❚❚ pause";
    const playNext = () => {
      const next = this.times.find((at) => at > this.place + MARGIN_S) ?? this.last;
      const due = this.inTime ? (next - from) * 1000 - (performance.now() - began) : PLAY_MS;
      this.timer = setTimeout(() => {
        this.timer = null;
        this.show(next);
        if (next < this.last) playNext();
        else this.pause();
      }, Math.max(due, 0));
    };
    playNext();
  }

  pause() {
    clearTimeout(this.timer);
    this.timer = null;
    this.playButton.textContent = "▶ play";
  }

  links() {
    const [first] = this.episodes;
    const same = this.rows.filter((row) => row.site === first.row.site && row.goal === first.row.goal
      && row.start === first.row.start && row.repetition === first.row.repetition && !this.numbers.includes(row.id));
    const isFull = this.numbers.length >= MOST_TOGETHER;
    const others = isFull ? [] : same.slice(-12).map((row) => make("a", { class: "chip", href: `#/compare/${this.numbers.join("/")}/${row.id}` },
      `${MARKS[row.outcome]} ${row.condition} #${row.id}`));
    const video = make("a", { class: "chip", id: "video", href: `video/${this.numbers.join("-")}.mp4`, download: "" }, "Video");
    const hasVideo = this.episodes.every((episode) => episode.row.has_images) && this.numbers.length <= (isStatic ? 1 : 2) && session.videos !== false;
    return make("nav", { class: "links", "aria-label": "episode" }, hasVideo ? video : "",
      ...(others.length ? [make("span", { class: "dim small" }, "next to"), ...others] : []));
  }

  facts(episode) {
    const { row } = episode;
    const tags = make("p", { class: "chips" }, ...row.tags.map((tag) => isStatic
      ? make("span", { class: "chip" }, tag)
      : make("button", { class: "chip", "aria-label": `remove tag ${tag}`, onclick: () => this.annotate(row, { removed_tags: [tag] }) }, `${tag} ×`)));
    const forms = isStatic ? [] : [
      this.form(row, "tag", "Add a tag", (text) => ({ tags: text.split(",") })),
      this.form(row, "note", "Add a note", (text) => ({ note: text })),
    ];
    const verdicts = episode.verdicts.filter((given, place) => !(place === 0 && episode.verdicts.length === 1 && !given.note)); // else it is in the banner
    const history = [
      ...verdicts.map((given) => ({ at: given.at, text: `${given.proposed ? "proposed: " : ""}${given.reason}${given.note ? `; ${given.note}` : ""}`,
        who: `${given.author}, ${given.source}`, parts: [] })),
      ...foldedEvents(episode.events),
    ].sort((a, b) => (a.at < b.at ? -1 : 1));
    const { "goal text": _shown, ...others } = episode.facts ?? {};
    const origin = factList([["weights", episode.weights], ["seed", String(episode.seed)], ["began", `${row.started_at} UTC`], ["error", episode.error], ...Object.entries(others)]);
    return make("section", { class: "card", "aria-label": `record of episode ${row.id}` }, make("h3", {}, this.numbers.length > 1 ? `Record of #${row.id}` : "Record"), tags, ...forms, origin,
      make("ol", { class: "history" }, ...history.map(({ at, text, who, parts }) => make("li", {}, make("span", { class: "dim small" }, `${at} `),
        parts.length ? make("details", {}, make("summary", {}, text), make("ul", { class: "small" }, ...parts.map((part) => make("li", {}, part)))) : text,
        who ? make("span", { class: "dim small" }, ` (${who})`) : ""))));
  }

  form(row, name, label, content) {
    const field = make("input", { class: "field", id: `${name}-${row.id}`, "data-annotation": name, maxlength: name === "tag" ? "200" : "2000", autocomplete: "off" });
    return make("form", { class: "annotate", onsubmit: (event) => {
      event.preventDefault();
      if (field.value.trim()) this.annotate(row, content(field.value));
    } }, make("label", { for: field.id, class: "small" }, label), field, make("button", { class: "chip" }, "Save"));
  }

  async annotate(row, change) {
    await this.onAnnotated(() => post("annotate", { episodes: [row.id], ...change }));
    await this.open(this.place);
  }

  focus(name) {
    this.element.querySelector(`[data-annotation="${name}"]`)?.focus();
  }
}
