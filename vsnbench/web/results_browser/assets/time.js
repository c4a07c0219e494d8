// Success over time: by day, and by version of a model.

const CHART_PX = 220;
const [LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX] = [44, 16, 12, 26];

const shareText = ([good, all]) => (all ? `${good}/${all}` : "");

class TimeView {
  constructor(rows, colors) {
    this.rows = rows.filter((row) => row.counts);
    this.colors = colors;
    this.days = [...new Set(this.rows.map(dayOf))].sort();
    this.models = [...colors.keys()].filter((name) => this.rows.some((row) => row.condition === name));
    this.chart = make("div", { class: "chart" });
    this.element = make("div", { class: "time" },
      this.rows.length ? "" : make("p", { class: "dim" }, "No counted episode yet."),
      make("section", { class: "card" }, make("h2", {}, "Success by day"), this.chart, this.byDay()),
      make("section", { class: "card" }, make("h2", {}, "Success by version of a model"), this.byVersion()));
    this.onResize = () => this.draw();
    addEventListener("resize", this.onResize);
  }

  close() {
    removeEventListener("resize", this.onResize);
  }

  // Draws the share of successes of each model on each day; a larger dot stands for more episodes.
  draw() {
    const width = this.chart.clientWidth;
    if (!width || !this.days.length) return;
    const [inner, height] = [width - LEFT_PX - RIGHT_PX, CHART_PX - TOP_PX - BOTTOM_PX];
    const x = (place) => LEFT_PX + (this.days.length === 1 ? inner / 2 : (place * inner) / (this.days.length - 1));
    const y = (share) => TOP_PX + (1 - share) * height;
    const svg = makeSvg("svg", { viewBox: `0 0 ${width} ${CHART_PX}`, width, height: CHART_PX, role: "img", "aria-label": "success rate by day; the numbers are in the table" });
    const text = (words, at, anchor) => { const made = makeSvg("text", { ...at, "text-anchor": anchor }); made.textContent = words; return made; };
    for (const share of [0, 0.5, 1]) {
      svg.append(makeSvg("line", { class: "rule", x1: LEFT_PX, x2: width - RIGHT_PX, y1: y(share), y2: y(share) }),
        text(`${share * 100} %`, { x: LEFT_PX - 6, y: y(share) + 4 }, "end"));
    }
    const every = Math.ceil(this.days.length / Math.max(1, Math.floor(inner / 90)));
    this.days.forEach((day, place) => { if (place % every === 0) svg.append(text(day, { x: x(place), y: CHART_PX - 6 }, "middle")); });
    const gap = Math.min(9, inner / this.days.length / (this.models.length + 1)); // equal shares of a day side by side
    this.models.forEach((model, index) => {
      const aside = (index - (this.models.length - 1) / 2) * gap;
      const at = (place) => x(place) + aside;
      const dots = this.days.map((day, place) => [place, successesOf(this.of(model, day))]).filter(([, [, all]]) => all);
      const line = makeSvg("polyline", { class: "series", points: dots.map(([place, [good, all]]) => `${at(place)},${y(good / all)}`).join(" ") });
      line.style.stroke = this.colors.get(model);
      svg.append(line, ...dots.map(([place, [good, all]]) => {
        const dot = makeSvg("circle", { cx: at(place), cy: y(good / all), r: Math.min(4 + Math.sqrt(all) / 2, 12) });
        dot.style.fill = this.colors.get(model);
        const title = makeSvg("title", {});
        title.textContent = `${model}, ${this.days[place]}: ${good} of ${all}`;
        dot.append(title);
        return dot;
      }));
    });
    this.chart.replaceChildren(svg);
  }

  of(model, day) {
    this.cells ??= grouped(this.rows, (row) => `${row.condition}\n${dayOf(row)}`);
    return this.cells.get(`${model}\n${day}`) ?? [];
  }

  byDay() {
    return tableOf("successes by day", ["day", ...this.models.map((model) => make("span", {}, swatch(this.colors.get(model)), model))],
      this.days.toReversed().map((day) => [day, ...this.models.map((model) => shareText(successesOf(this.of(model, day))))]));
  }

  byVersion() {
    const versions = grouped(this.rows, (row) => JSON.stringify([row.condition, row.version]));
    const lines = [...versions].map(([key, rows]) => {
      const [model, version] = JSON.parse(key);
      const days = rows.map(dayOf).sort();
      return { model, version, first: days[0], last: days.at(-1), share: successesOf(rows) };
    });
    lines.sort((a, b) => this.models.indexOf(a.model) - this.models.indexOf(b.model) || (a.first < b.first ? -1 : 1));
    return tableOf("successes by version", ["model", "version", "first day", "last day", "k/n", "success"], lines.map(({ model, version, first, last, share }) => [
      make("span", {}, swatch(this.colors.get(model)), model), version || "–", make("span", { class: "day" }, first), make("span", { class: "day" }, last), shareText(share), `${Math.round((100 * share[0]) / share[1])}\u00a0%`]));
  }
}

const dayOf = (row) => row.started_at.slice(0, 10);

function tableOf(name, headings, lines) {
  return make("div", { class: "wide", tabindex: "0", role: "region", "aria-label": name },
    make("table", { class: "plain" }, make("thead", {}, make("tr", {}, ...headings.map((heading) => make("th", { scope: "col" }, heading)))),
      make("tbody", {}, ...lines.map(([first, ...rest]) => make("tr", {}, make("th", { scope: "row" }, first), ...rest.map((cell) => make("td", {}, cell)))))));
}
