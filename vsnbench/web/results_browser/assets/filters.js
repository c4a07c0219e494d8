// The filters above the results. Their values are in the address, so that a view can be pasted.

const NAMES = ["model", "disturbances", "goal", "start", "outcome", "end_reason", "failure", "tag", "site", "nearest", "differ"];
const LABELS = {
  model: "Model", disturbances: "Disturbed", goal: "Goal", start: "Start", outcome: "Outcome", end_reason: "Ended with", failure: "Failure", tag: "Tag", site: "Site",
  nearest: "Ended within", differ: "Disagree",
};
const UNDISTURBED = "none";
const DISTANCES = ["1", "1.5", "2", "3"];

const distinct = (rows, name) => [...new Set(rows.map((row) => row[name]).filter((value) => value !== ""))];

function choices(rows, name) {
  switch (name) {
    case "tag":
      return [...new Set(rows.flatMap((row) => row.tags))].sort();
    case "start":
      return distinct(rows, name).sort((a, b) => a - b).map(String);
    case "nearest":
      return DISTANCES;
    case "differ": {
      const models = distinct(rows, "condition").sort();
      return models.flatMap((a) => models.filter((b) => b !== a).map((b) => `${a} failed, ${b} succeeded`));
    }
    case "disturbances": {
      const disturbed = distinct(rows, name).sort();
      return disturbed.length ? [UNDISTURBED, ...disturbed] : [];
    }
    default:
      return distinct(rows, name).sort();
  }
}

function filterBar(rows, chosen, onChange) {
  const fields = NAMES.map((name) => {
    const options = choices(rows, name);
    if (options.length < 2 && !chosen[name] && name !== "tag") return null;
    if (!options.length && !chosen[name]) return null;
    if (chosen[name] && !options.includes(chosen[name])) options.push(chosen[name]);
    const select = make("select", { class: "field", id: `filter-${name}`, onchange: (event) => onChange(name, event.target.value) });
    select.append(make("option", { value: "" }, name === "differ" ? "no matter" : "all"));
    for (const value of options) {
      const text = name === "nearest" ? `${value} m of the goal` : value.replaceAll("_", " ");
      select.append(make("option", { value }, text));
    }
    select.value = chosen[name] ?? "";
    return make("label", { class: select.value ? "filter on" : "filter" }, LABELS[name], select);
  });
  const clear = make("button", { class: "chip", onclick: () => onChange(null) }, "Clear");
  return make("form", { class: "filters", id: "filters", role: "search", "aria-label": "filters" }, ...fields, clear);
}

function matching(rows, chosen) {
  const simple = ["model", "goal", "outcome", "end_reason", "failure", "site"].filter((name) => chosen[name]);
  const nearest = chosen.nearest ? Number(chosen.nearest) : null;
  return rows.filter((row) =>
    simple.every((name) => row[name] === chosen[name])
    && (!chosen.disturbances || row.disturbances === (chosen.disturbances === UNDISTURBED ? "" : chosen.disturbances))
    && (!chosen.start || String(row.start) === chosen.start)
    && (!chosen.tag || row.tags.includes(chosen.tag))
    && (nearest === null || (row.distance_m !== null && row.distance_m <= nearest)));
}

const trialOf = (row) => JSON.stringify([row.site, row.goal, row.start, row.repetition]);

// Pairs of counted episodes of one trial in which the first condition failed and the second succeeded.
function disagreements(rows, chosen) {
  const [first, second] = (chosen.differ ?? "").replace(/ succeeded$/, "").split(" failed, ");
  const others = new Map();
  for (const row of rows) {
    if (row.counts && row.condition === second && row.outcome === "success") others.set(trialOf(row), row);
  }
  const { differ, model, disturbances, outcome, end_reason, nearest, failure, ...shared } = chosen;
  return matching(rows, shared)
    .filter((row) => row.counts && row.condition === first && row.outcome === "failure" && others.has(trialOf(row))
      && (!failure || row.failure === failure))
    .map((row) => [row, others.get(trialOf(row))]);
}
