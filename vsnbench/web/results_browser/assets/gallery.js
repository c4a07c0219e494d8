// The gallery: a card for each episode, in groups. Only the visible cards are in the document.

const CARD_PX = 290; // least width
const GAP_PX = 12;
const MOST_TOGETHER = 4;
const LOAD_MS = 60; // cards that are scrolled past are not loaded
const cards = new Map(); // what is known of finished episodes
const together = new Set(); // episodes to play on one time axis

// Groups of episodes: failures first, each with those of other causes before successes; by size.
function groupsOf(rows, by, colors) {
  const rank = (group) => ["failure", "unjudged", "running", "void", "success"].indexOf(group[0].outcome);
  const order = { goal: (a, b) => a[0].localeCompare(b[0]), model: (a, b) => [...colors.keys()].indexOf(a[0]) - [...colors.keys()].indexOf(b[0]) };
  return [...grouped(rows, GROUPS[by] ?? GROUPS.cause)].sort(order[by] ?? ((a, b) => rank(a[1]) - rank(b[1]) || b[1].length - a[1].length));
}

class Gallery {
  constructor(groups, by, colors) {
    this.groups = groups;
    this.by = by;
    this.colors = colors;
    this.rows = groups.flatMap(([, rows]) => rows);
    this.places = new Map(this.rows.map((row, place) => [row.id, place]));
    this.lines = [];
    this.drawn = new Map(); // elements by the index of their line
    this.marked = 0;
    this.holder = make("div", { class: "rows" });
    this.bar = make("div", { class: "together", hidden: true });
    this.element = make("div", { class: "gallery" }, this.holder, this.bar);
    this.onScroll = () => this.draw();
    addEventListener("scroll", this.onScroll, { passive: true });
    addEventListener("resize", this.onScroll);
  }

  close() {
    clearTimeout(this.loading);
    removeEventListener("scroll", this.onScroll);
    removeEventListener("resize", this.onScroll);
  }

  // Divides the groups into lines of as many cards as fit.
  layOut(width) {
    const style = getComputedStyle(this.element);
    const [head, card] = ["--head", "--card-height"].map((name) => Number.parseFloat(style.getPropertyValue(name)));
    this.width = width;
    this.columns = Math.max(1, Math.floor((width + GAP_PX) / (CARD_PX + GAP_PX)));
    this.lines = [];
    let top = 0;
    const add = (height, line) => { this.lines.push({ ...line, top, height }); top += height; };
    for (const [name, rows] of this.groups) {
      if (this.by !== "none") add(head, { name, rows, isHead: true });
      for (let at = 0; at < rows.length; at += this.columns) add(card + GAP_PX, { rows: rows.slice(at, at + this.columns) });
    }
    this.holder.style.height = `${top}px`;
    this.drawn.clear();
  }

  draw() {
    const width = this.element.clientWidth;
    if (width && width !== this.width) this.layOut(width);
    const above = -this.holder.getBoundingClientRect().top;
    const first = Math.max(0, this.lines.findIndex((line) => line.top + line.height > above - 300));
    const past = this.lines.findIndex((line) => line.top > above + innerHeight + 300);
    const last = past < 0 ? this.lines.length : past;
    const elements = [];
    for (let i = first; i < last; i += 1) elements.push([i, this.drawn.get(i) ?? this.lineOf(this.lines[i])]);
    const isSame = elements.length === this.drawn.size && elements.every(([i]) => this.drawn.has(i));
    if (!isSame) {
      const focused = document.activeElement?.dataset?.place;
      this.drawn = new Map(elements);
      this.holder.replaceChildren(...this.drawn.values());
      if (focused !== undefined) this.linkAt(focused)?.focus({ preventScroll: true });
    }
    clearTimeout(this.loading);
    this.loading = setTimeout(() => this.load(), LOAD_MS);
    this.drawBar();
  }

  linkAt(place) {
    return this.holder.querySelector(`[data-place="${place}"]`);
  }

  lineOf(line) {
    const element = line.isHead ? this.headOf(line) : make("div", { class: "tiles" }, ...line.rows.map((row) => this.tile(row)));
    element.style.transform = `translateY(${line.top}px)`;
    element.style.setProperty("--columns", this.columns);
    return element;
  }

  headOf({ name, rows }) {
    const [good, all] = successesOf(rows);
    const isCause = this.by === "cause" || !this.by;
    return make("h2", { class: "group" }, this.by === "model" ? swatch(this.colors.get(name)) : "", name,
      make("span", { class: "dim small" }, ` ${counted(rows.length, "episode")}${isCause || !all ? "" : `, ${good} of ${all} succeeded`}`));
  }

  tile(row) {
    const picture = make("span", { class: "shot" });
    const plan = make("span", { class: "plan", "aria-hidden": "true" });
    const words = [...row.tags.map((tag) => `#${tag}`), ...row.notes].join(" · ") || row.goal_text;
    const pick = make("input", { type: "checkbox", checked: together.has(row.id), onchange: (event) => this.pick(row.id, event.target) });
    const element = make("article", { class: `tile ${row.outcome}`, "data-number": String(row.id) },
      make("a", { href: `#/episode/${row.id}`, class: "open", "data-place": String(this.places.get(row.id)) },
        make("span", { class: "pictures" }, picture, plan),
        outcomeChip(row),
        make("span", { class: "what" }, swatch(this.colors.get(row.condition)), row.condition),
        make("span", { class: "dim small" }, `${row.goal} from start ${row.start}${row.repetition > 1 ? ` (${row.repetition})` : ""} · #${row.id}`),
        make("span", { class: "small" }, [row.distance_m === null ? "" : `${metres(row.distance_m)} to the goal`, counted(row.actions, "action")].filter(Boolean).join(" · ")),
        words ? make("span", { class: "words small" }, words) : ""),
      make("label", { class: "pick small" }, pick, make("span", {}, "side by side", make("span", { class: "unseen" }, `: episode ${row.id}`))));
    if (cards.has(row.id)) fillTile(row, cards.get(row.id), picture, plan);
    return element;
  }

  // Loads what the visible cards show.
  async load() {
    const tiles = [...this.holder.querySelectorAll(".tile")];
    const shown = tiles.map((tile) => [tile, this.rows[this.places.get(Number(tile.dataset.number))]]);
    const missing = shown.filter(([tile, row]) => !cards.has(row.id) && !tile.dataset.loaded);
    if (!missing.length) return;
    for (const [tile] of missing) tile.dataset.loaded = "1";
    try {
      const found = await loadCards(missing.map(([, row]) => row.id));
      for (const [tile, row] of missing) {
        if (!found[row.id]) continue;
        if (row.outcome !== "running") cards.set(row.id, found[row.id]);
        fillTile(row, found[row.id], tile.querySelector(".shot"), tile.querySelector(".plan"));
      }
    } catch {
      for (const [tile] of missing) delete tile.dataset.loaded; // the page says that the results cannot be read
    }
  }

  pick(number, box) {
    if (box.checked) together.add(number); else together.delete(number);
    if (together.size > MOST_TOGETHER) {
      together.delete(number);
      box.checked = false;
    }
    this.drawBar();
  }

  drawBar() {
    this.bar.hidden = !together.size;
    if (this.bar.hidden) return;
    const numbers = [...together];
    const play = numbers.length > 1 ? make("a", { class: "chip on", href: `#/compare/${numbers.join("/")}` }, `Play ${numbers.length} together`)
      : make("span", { class: "dim" }, `choose up to ${MOST_TOGETHER} to play together`);
    this.bar.replaceChildren(make("span", {}, numbers.map((number) => `#${number}`).join(", ")), play,
      make("button", { class: "chip", onclick: () => { together.clear(); for (const box of this.holder.querySelectorAll(".pick input")) box.checked = false; this.drawBar(); } }, "Clear"));
  }

  move(by) {
    const active = document.activeElement?.dataset?.place;
    if (active !== undefined) this.marked = Number(active) + by;
    this.marked = Math.max(0, Math.min(this.marked, this.rows.length - 1));
    if (!this.rows.length) return;
    const row = this.rows[this.marked];
    const line = this.lines.find(({ isHead, rows }) => !isHead && rows.includes(row));
    const top = this.holder.getBoundingClientRect().top + line.top;
    if (top < 60) scrollBy(0, top - 60);
    if (top + line.height > innerHeight - 60) scrollBy(0, top + line.height - innerHeight + 60);
    this.draw();
    this.linkAt(this.marked)?.focus({ preventScroll: true });
  }

  open() {
    if (this.rows[this.marked]) location.hash = `#/episode/${this.rows[this.marked].id}`;
  }
}

// Shows the last picture and the path.
function fillTile(row, card, picture, plan) {
  if (row.has_images && card.image !== null) {
    const image = make("img", { alt: "", onerror: () => { picture.textContent = "no picture"; } });
    image.src = pictureOf(row.id, String(card.image)).address;
    picture.replaceChildren(image);
  } else {
    picture.textContent = "no picture";
  }
  planOf(card).then((svg) => {
    for (const object of svg.querySelectorAll(".object")) object.classList.toggle("goal", object.querySelector("title")?.textContent === row.goal);
    const points = card.path;
    if (points.length) {
      svg.querySelector("g.plan").append(makeSvg("polyline", { class: "path", points: points.map((point) => point.join(",")).join(" ") }),
        makeSvg("circle", { class: "begin", cx: points[0][0], cy: points[0][1], r: 0.16 }),
        makeSvg("circle", { class: `robot ${row.outcome}`, cx: points.at(-1)[0], cy: points.at(-1)[1], r: 0.24 }));
    }
    plan.replaceChildren(svg);
  }).catch(() => { plan.textContent = "no plan"; });
}
