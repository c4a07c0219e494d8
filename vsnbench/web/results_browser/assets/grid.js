// The grid of trials: goals by starting positions, a table for each model and its disturbances.

const MOST_MARKS = 3;

function gridOf(rows, addressOf) {
  const models = [...new Set(rows.map((row) => row.condition))].sort();
  const starts = [...new Set(rows.map((row) => row.start))].sort((a, b) => a - b);
  const tables = models.map((model) => {
    const own = rows.filter((row) => row.condition === model);
    const counted = own.filter((row) => row.counts);
    const good = counted.filter((row) => row.outcome === "success").length;
    const cells = new Map();
    for (const row of own) {
      const key = `${row.goal}\n${row.start}`;
      cells.set(key, [...(cells.get(key) ?? []), row]);
    }
    const goals = [...new Set(own.map((row) => row.goal))].sort();
    const head = make("tr", {}, make("th", { scope: "col" }, "goal"),
      ...starts.map((start) => make("th", { scope: "col" }, String(start))), make("th", { scope: "col" }, "success"));
    const lines = goals.map((goal) => {
      const all = counted.filter((row) => row.goal === goal);
      const successes = all.filter((row) => row.outcome === "success").length;
      return make("tr", {}, make("th", { scope: "row" }, goal),
        ...starts.map((start) => cellOf(cells.get(`${goal}\n${start}`) ?? [], addressOf, { goal, start })),
        make("td", { class: "sum" }, all.length ? `${successes}/${all.length}` : ""));
    });
    return make("section", { class: "card" },
      make("h2", {}, model, make("span", { class: "dim small" }, ` ${good} of ${counted.length} succeeded`)),
      make("div", { class: "wide", tabindex: "0", role: "region", "aria-label": `trials of ${model}` },
        make("table", { class: "grid" }, make("thead", {}, head), make("tbody", {}, ...lines))));
  });
  return make("div", { class: "grids" }, ...tables);
}

function cellOf(rows, addressOf, { goal, start }) {
  if (!rows.length) return make("td", {});
  const shown = rows.filter((row) => row.state !== "superseded");
  if (shown.length > MOST_MARKS) {
    const decided = shown.filter((row) => row.counts);
    const good = decided.filter((row) => row.outcome === "success").length;
    const share = decided.length ? good / decided.length : 0;
    const { model, disturbances } = rows[0];
    const own = { model, disturbances: disturbances || UNDISTURBED };
    const link = make("a", { href: addressOf({ ...own, goal, start: String(start), view: "list" }), class: "ratio" }, `${good}/${decided.length}`);
    link.style.setProperty("--share", `${Math.round(share * 100)}%`);
    return make("td", {}, link);
  }
  return make("td", {}, ...shown.map((row) => make(
    "a", { href: `#/episode/${row.id}`, class: `mark ${row.outcome}`, title: `#${row.id} ${resultText(row)}`,
      "aria-label": `episode ${row.id}, ${goal} from start ${start}: ${resultText(row)}` }, MARKS[row.outcome])));
}
