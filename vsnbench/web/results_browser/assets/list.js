// The list of episodes. Only the visible rows are in the document, so that ten thousand scroll.

const cells = (row) => [
  ["id", `#${row.id}`],
  ["model", row.condition],
  ["goal", row.goal],
  ["start", `start ${row.start}${row.repetition > 1 ? ` (${row.repetition})` : ""}`],
  [`result ${row.outcome}`, `${MARKS[row.outcome]} ${resultText(row)}`],
  ["actions", `${row.actions} actions`],
  ["distance", metres(row.distance_m)],
  ["tags", row.tags.join(", ")],
  ["began", row.started_at.slice(0, 16)],
];

const pairCells = ([a, b]) => [
  ["id", `#${a.id} #${b.id}`],
  ["model", `${a.condition} / ${b.condition}`],
  ["goal", a.goal],
  ["start", `start ${a.start}${a.repetition > 1 ? ` (${a.repetition})` : ""}`],
  ["result failure", `${MARKS.failure} ${resultText(a)}`],
  ["result success", `${MARKS.success} ${b.actions} actions`],
  ["tags", [...new Set([...a.tags, ...b.tags])].join(", ")],
];

const HEADINGS = ["episode", "model", "goal", "start", "result", "actions", "to goal", "tags", "began (UTC)"];
const PAIR_HEADINGS = ["episodes", "models", "goal", "start", "first", "second", "tags"];

class EpisodeList {
  // `items` are rows, or pairs of rows; `link` gives the address of one.
  constructor(items, link, isPairs) {
    this.items = items;
    this.link = link;
    this.isPairs = isPairs;
    this.marked = 0;
    const headings = (isPairs ? PAIR_HEADINGS : HEADINGS).map((text, i) =>
      make("span", { role: "columnheader", class: `cell h${i}` }, text));
    this.rows = make("div", { role: "rowgroup", class: "rows" });
    this.element = make(
      "div", { role: "table", class: isPairs ? "list pairs" : "list", "aria-label": "episodes", "aria-rowcount": String(items.length + 1) },
      make("div", { role: "rowgroup" }, make("div", { role: "row", class: "line head" }, ...headings)), this.rows,
    );
    this.onScroll = () => this.draw();
    addEventListener("scroll", this.onScroll, { passive: true });
    addEventListener("resize", this.onScroll);
  }

  close() {
    removeEventListener("scroll", this.onScroll);
    removeEventListener("resize", this.onScroll);
  }

  draw() {
    const height = Number.parseFloat(getComputedStyle(this.element).getPropertyValue("--row")) || 44;
    this.height = height;
    this.rows.style.height = `${this.items.length * height}px`;
    const top = this.rows.getBoundingClientRect().top;
    const first = Math.max(0, Math.floor(-top / height) - 8);
    const last = Math.min(this.items.length, Math.ceil((innerHeight - top) / height) + 8);
    const lines = [];
    for (let i = first; i < last; i += 1) lines.push(this.line(i, height));
    const focused = document.activeElement?.dataset?.place;
    this.rows.replaceChildren(...lines);
    if (focused !== undefined) this.rows.querySelector(`[data-place="${focused}"]`)?.focus({ preventScroll: true });
  }

  line(i, height) {
    const item = this.items[i];
    const [first, ...rest] = this.isPairs ? pairCells(item) : cells(item);
    const link = make("a", { href: this.link(item), "data-place": String(i), class: "open" }, first[1]);
    const line = make(
      "div", { role: "row", class: i === this.marked ? "line marked" : "line", "aria-rowindex": String(i + 2) },
      make("span", { role: "cell", class: "cell id" }, link),
      ...rest.map(([name, text]) => make("span", { role: "cell", class: `cell ${name}` }, text)),
    );
    line.style.transform = `translateY(${i * height}px)`;
    line.addEventListener("click", () => { location.hash = link.getAttribute("href").slice(1); });
    return line;
  }

  move(by) {
    this.marked = Math.min(Math.max(this.marked + by, 0), this.items.length - 1);
    const top = this.rows.getBoundingClientRect().top + this.marked * this.height;
    if (top < 120) scrollBy(0, top - 120);
    if (top > innerHeight - 2 * this.height) scrollBy(0, top - innerHeight + 2 * this.height);
    this.draw();
    this.rows.querySelector(`[data-place="${this.marked}"]`)?.focus({ preventScroll: true });
  }

  open() {
    if (this.items[this.marked]) location.hash = this.link(this.items[this.marked]).slice(1);
  }
}
