// The table of episodes. Only the visible rows are in the document, so that ten thousand scroll.

// Columns: heading, class, width, text. Those in which every line is empty are left out.
const COLUMNS = [
  ["episode", "id", "5.5rem", (row) => `#${row.id}`],
  ["model", "model", "minmax(6rem, 1.5fr)", (row) => row.condition],
  ["goal", "goal", "minmax(5rem, 1fr)", (row) => row.goal],
  ["start", "start", "6.5rem", (row) => `start ${row.start}${row.repetition > 1 ? ` (${row.repetition})` : ""}`],
  ["result", "result", "minmax(11rem, 2fr)", (row) => `${MARKS[row.outcome]} ${causeOf(row)}`, (row) => row.outcome],
  ["actions", "actions", "6.5rem", (row) => counted(row.actions, "action")],
  ["to goal", "distance", "5.5rem", (row) => metres(row.distance_m)],
  ["tags, notes", "tags", "minmax(6rem, 1.5fr)", (row) => [...row.tags, ...row.notes].join(", ")],
  ["began (UTC)", "began", "10.5rem", (row) => row.started_at.slice(0, 16)],
];
const PAIR_COLUMNS = [
  ["episodes", "id", "8rem", ([a, b]) => `#${a.id} #${b.id}`],
  ["models", "model", "minmax(8rem, 2fr)", ([a, b]) => `${a.condition} / ${b.condition}`],
  ["goal", "goal", "minmax(5rem, 1fr)", ([a]) => a.goal],
  ["start", "start", "6.5rem", ([a]) => `start ${a.start}${a.repetition > 1 ? ` (${a.repetition})` : ""}`],
  ["first", "result failure", "minmax(9rem, 1.6fr)", ([a]) => `${MARKS.failure} ${causeOf(a)}`],
  ["second", "result success", "minmax(7rem, 1fr)", ([, b]) => `${MARKS.success} ${counted(b.actions, "action")}`],
  ["tags", "tags", "minmax(5rem, 1fr)", ([a, b]) => [...new Set([...a.tags, ...b.tags])].join(", ")],
];

class EpisodeList {
  // `items` are rows, or pairs of rows; `link` gives the address of one.
  constructor(items, link, isPairs) {
    this.items = items;
    this.link = link;
    this.marked = 0;
    this.columns = (isPairs ? PAIR_COLUMNS : COLUMNS).filter(([, , , text]) => items.some(text));
    const headings = this.columns.map(([heading]) => make("span", { role: "columnheader", class: "cell" }, heading));
    this.rows = make("div", { role: "rowgroup", class: "rows" });
    this.element = make(
      "div", { role: "table", class: isPairs ? "list pairs" : "list", "aria-label": "episodes", "aria-rowcount": String(items.length + 1) },
      make("div", { role: "rowgroup" }, make("div", { role: "row", class: "line head" }, ...headings)), this.rows,
    );
    this.element.style.setProperty("--widths", this.columns.map(([, , width]) => width).join(" "));
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
    const [[, , , number], ...rest] = this.columns;
    const link = make("a", { href: this.link(item), "data-place": String(i), class: "open" }, number(item));
    const line = make(
      "div", { role: "row", class: i === this.marked ? "line marked" : "line", "aria-rowindex": String(i + 2) },
      make("span", { role: "cell", class: "cell id" }, link),
      ...rest.map(([, name, , text, kind]) => make("span", { role: "cell", class: `cell ${name} ${kind?.(item) ?? ""}` }, text(item))),
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
