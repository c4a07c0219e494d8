// The grid of trials: goals by starting positions, a table for each model and its disturbances.

const MOST_MARKS = 3;

function gridOf(rows, colors, addressOf) {
  const models = [...colors.keys()].filter((model) => rows.some((row) => row.condition === model));
  const starts = [...new Set(rows.map((row) => row.start))].sort((a, b) => a - b);
  const tables = models.map((model) => {
    const own = rows.filter((row) => row.condition === model);
    const [good, all] = successesOf(own);
    const cells = grouped(own, (row) => `${row.goal}\n${row.start}`);
    const goals = [...new Set(own.map((row) => row.goal))].sort();
    const head = make("tr", {}, make("th", { scope: "col" }, "goal"),
      ...starts.map((start) => make("th", { scope: "col" }, String(start))), make("th", { scope: "col" }, "success"));
    const lines = goals.map((goal) => {
      return make("tr", {}, make("th", { scope: "row" }, goal),
        ...starts.map((start) => cellOf(cells.get(`${goal}\n${start}`) ?? [], addressOf, { goal, start })),
        make("td", { class: "sum" }, shareText(successesOf(own.filter((row) => row.goal === goal)))));
    });
    return make("section", { class: "card" },
      make("h2", {}, swatch(colors.get(model)), model, make("span", { class: "dim small" }, ` ${good} of ${all} succeeded`)),
      make("div", { class: "wide", tabindex: "0", role: "region", "aria-label": `trials of ${model}` },
        make("table", { class: "grid" }, make("thead", {}, head), make("tbody", {}, ...lines))));
  });
  return make("div", { class: "grids" }, ...tables);
}

function cellOf(rows, addressOf, { goal, start }) {
  if (!rows.length) return make("td", {});
  const shown = rows.filter((row) => row.state !== "superseded");
  if (shown.length > MOST_MARKS) {
    const [good, all] = successesOf(shown);
    const { model, disturbances } = rows[0];
    const own = { model, disturbances: disturbances || UNDISTURBED };
    const link = make("a", { href: addressOf({ ...own, goal, start: String(start), view: "list" }), class: "ratio" }, `${good}/${all}`);
    link.style.setProperty("--share", `${all ? Math.round((100 * good) / all) : 0}%`);
    return make("td", {}, link);
  }
  return make("td", {}, ...shown.map((row) => make(
    "a", { href: `#/episode/${row.id}`, class: `mark ${row.outcome}`, title: `#${row.id} ${resultText(row)}`,
      "aria-label": `episode ${row.id}, ${goal} from start ${start}: ${resultText(row)}` }, MARKS[row.outcome])));
}
