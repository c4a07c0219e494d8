// One episode, or two of one trial side by side, step by step.

const PLAY_MS = 250;
const PRELOADED = 6;
const SCORES = 6;

// Camera, plan, action and scores of one episode at a step.
class Player {
  constructor(episode) {
    this.episode = episode;
    this.plan = new Plan(episode);
    this.image = make("img", { alt: "", class: "camera" });
    this.none = make("p", { class: "dim none", hidden: true }, "No image of this step.");
    this.action = make("p", { class: "action" });
    this.scores = make("div", { class: "scores" });
    this.banner = make("p", { class: "banner" });
    const { row } = episode;
    this.element = make("article", { class: "player", "aria-label": `episode ${row.id}` },
      make("h2", {}, make("a", { href: `#/episode/${row.id}` }, `#${row.id}`), ` ${row.condition} `,
        make("span", { class: "dim small" }, `${row.goal} from start ${row.start}`)),
      make("div", { class: "stage" }, make("figure", {}, this.image, this.none), this.plan.holder), this.banner, this.action, this.scores);
    this.image.addEventListener("error", () => { this.image.hidden = true; this.none.hidden = false; });
  }

  get last() {
    return this.episode.steps.length;
  }

  show(place) {
    const { steps, row } = this.episode;
    const isEnd = place >= steps.length;
    const step = steps[Math.min(place, steps.length - 1)];
    this.plan.draw(Math.min(place, steps.length));
    this.banner.className = `banner ${isEnd ? row.outcome : "driving"}`;
    const verdict = this.episode.verdicts.filter((given) => !given.proposed).at(-1);
    this.banner.textContent = isEnd
      ? `${MARKS[row.outcome]} ${verdict ? verdict.reason : resultText(row)}`
      : `action ${step.number} of at most ${this.episode.max_actions ?? "?"}${step.time_s === null ? "" : `, ${step.time_s.toFixed(1)} s`}`;
    if (!step) return;
    this.image.hidden = !step.has_image || !row.has_images;
    this.none.hidden = !this.image.hidden;
    if (!this.image.hidden) {
      const address = `images/${row.id}/${step.number}.jpg`;
      if (this.image.getAttribute("src") !== address) this.image.src = address;
      this.image.alt = `camera before action ${step.number}`;
      for (const next of steps.slice(place + 1, place + PRELOADED)) new Image().src = `images/${row.id}/${next.number}.jpg`;
    }
    const notes = [step.blocked && "blocked by the depth guard", step.refusal, step.touched && `collision: ${step.touched}`, step.failure]
      .filter(Boolean);
    const raw = step.raw_action && step.raw_action !== step.action ? ` (${step.raw_action})` : "";
    this.action.replaceChildren(make("strong", {}, `${step.action.replaceAll("_", " ").toLowerCase()}${raw}`),
      ...notes.map((text) => make("span", { class: "warn" }, ` ${text}`)),
      step.infer_s === null ? "" : make("span", { class: "dim small" }, ` decided in ${(step.infer_s * 1000).toFixed(0)} ms`));
    const scores = Object.entries(step.scores).sort((a, b) => b[1] - a[1]).slice(0, SCORES);
    this.scores.replaceChildren(...scores.map(([name, score]) => {
      const bar = make("div", { class: "score" }, make("span", {}, name.replaceAll("_", " ").toLowerCase()), make("span", {}, score.toFixed(2)));
      bar.style.setProperty("--share", `${Math.max(0, Math.min(1, score)) * 100}%`);
      return bar;
    }), ...Object.entries(step.values).map(([name, value]) => make("div", { class: "detail small" }, `${name}: ${value}`)),
    step.note ? make("p", { class: "small" }, step.note) : "");
  }
}

class EpisodePage {
  constructor(numbers, rows, onAnnotated) {
    this.numbers = numbers;
    this.rows = rows;
    this.onAnnotated = onAnnotated;
    this.element = make("div", { class: "episode" });
    this.timer = null;
    this.place = 0;
  }

  async open(place) {
    const episodes = await Promise.all(this.numbers.map((number) => load(`data/episode-${number}.json`)));
    for (const episode of episodes) episode.row = titled(episode.row);
    this.episodes = episodes;
    this.players = episodes.map((episode) => new Player(episode));
    this.last = Math.max(...this.players.map((player) => player.last));
    this.slider = make("input", { type: "range", min: "0", max: String(this.last), step: "1", "aria-label": "step", id: "slider",
      oninput: () => this.show(Number(this.slider.value)) });
    this.playButton = make("button", { class: "chip", id: "play", onclick: () => this.toggle() }, "▶ play");
    this.where = make("span", { class: "dim", role: "status" });
    const bar = make("div", { class: "transport" },
      make("button", { class: "chip", "aria-label": "previous step", onclick: () => this.step(-1) }, "←"), this.playButton,
      make("button", { class: "chip", "aria-label": "next step", onclick: () => this.step(1) }, "→"), this.slider, this.where);
    this.element.replaceChildren(this.links(), make("div", { class: this.players.length > 1 ? "players two" : "players" },
      ...this.players.map((player) => player.element)), bar, ...episodes.map((episode) => this.facts(episode)));
    this.show(Math.min(place ?? 0, this.last));
  }

  close() {
    clearInterval(this.timer);
  }

  show(place) {
    this.place = Math.min(Math.max(place, 0), this.last);
    this.slider.value = String(this.place);
    for (const player of this.players) player.show(this.place);
    const isEnd = this.place === this.last;
    this.where.textContent = isEnd ? `end (${this.last} steps)` : `step ${this.place + 1} of ${this.last}`;
    if (isEnd) this.pause();
  }

  step(by) {
    this.show(this.place + by);
  }

  toggle() {
    if (this.timer) { this.pause(); return; }
    if (this.place === this.last) this.show(0);
    this.timer = setInterval(() => this.step(1), PLAY_MS);
    this.playButton.textContent = "❚❚ pause";
  }

  pause() {
    clearInterval(this.timer);
    this.timer = null;
    this.playButton.textContent = "▶ play";
  }

  links() {
    const [first] = this.episodes;
    const same = this.rows.filter((row) => row.site === first.row.site && row.goal === first.row.goal
      && row.start === first.row.start && row.repetition === first.row.repetition && !this.numbers.includes(row.id));
    const others = same.slice(-12).map((row) => make("a", { class: "chip", href: `#/compare/${first.row.id}/${row.id}` },
      `${MARKS[row.outcome]} ${row.condition} #${row.id}`));
    const video = make("a", { class: "chip", id: "video", href: `video/${this.numbers.join("-")}.mp4`, download: "" }, "Video");
    return make("nav", { class: "links", "aria-label": "episode" }, make("a", { class: "chip", href: "#/" }, "← results"),
      this.episodes.every((episode) => episode.row.has_images) && !(isStatic && this.numbers.length > 1) ? video : "",
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
    const history = [
      ...episode.verdicts.map((given) => [given.at, `${given.proposed ? "proposed: " : ""}${given.reason}${given.note ? `; ${given.note}` : ""}`,
        `${given.author}, ${given.source}`]),
      ...episode.events.map((event) => [event.at, `${event.kind.replaceAll("_", " ")}${event.step ? ` at action ${event.step}` : ""}: ${event.text}`, event.author]),
    ].sort((a, b) => (a[0] < b[0] ? -1 : 1));
    const summary = [["result", resultText(row)], ["distance", metres(row.distance_m)], ["stopped", episode.stopped], ["path", `${metres(row.path_m)}, shortest ${metres(row.shortest_m)}`],
      ["weights", episode.weights], ["seed", String(episode.seed)], ["began", `${row.started_at} UTC`], ["error", episode.error], ...Object.entries(episode.facts ?? {})];
    return make("section", { class: "card", "aria-label": `record of episode ${row.id}` }, make("h3", {}, `Episode ${row.id}`), tags, ...forms,
      make("dl", { class: "facts" }, ...summary.filter(([, text]) => text).flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)])),
      make("ol", { class: "history" }, ...history.map(([at, text, who]) => make("li", {}, make("span", { class: "dim small" }, `${at} `), text,
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
