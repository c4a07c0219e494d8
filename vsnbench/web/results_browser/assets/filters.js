// The filters above the results. Their values are in the address, so that a view can be pasted.

const NAMES = ["model", "disturbances", "goal", "start", "outcome", "end_reason", "failure", "tag", "site", "nearest", "differ", "q", "group"];
const LABELS = {
  model: "Model", disturbances: "Disturbed", goal: "Goal", start: "Start", outcome: "Outcome", end_reason: "Ended with", failure: "Failure", tag: "Tag", site: "Site",
  nearest: "Ended within", differ: "Disagree", group: "Grouped by",
};
const UNDISTURBED = "none";
const SEARCH_MS = 120;
const GROUPS = { cause: causeOf, goal: (row) => row.goal, model: (row) => row.condition, none: () => "" };
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
    case "group":
      return Object.keys(GROUPS);
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

function filterBar(rows, chosen, view, onChange, onSearch) {
  const search = make("input", { class: "field", type: "search", id: "search", autocomplete: "off", placeholder: "notes, causes, words of goals",
    oninput: () => { clearTimeout(search.waiting); search.waiting = setTimeout(() => onSearch(search.value.trim()), SEARCH_MS); } });
  search.value = chosen.q ?? "";
  const fields = NAMES.map((name) => {
    if (name === "q" || (name === "group" && view !== "gallery")) return null;
    const options = choices(rows, name);
    if (options.length < 2 && !chosen[name] && name !== "tag") return null;
    if (!options.length && !chosen[name]) return null;
    if (chosen[name] && !options.includes(chosen[name])) options.push(chosen[name]);
    const select = make("select", { class: "field", id: `filter-${name}`, onchange: (event) => onChange(name, event.target.value) });
    if (name !== "group") select.append(make("option", { value: "" }, name === "differ" ? "no matter" : "all"));
    for (const value of options) {
      const text = name === "nearest" ? `${value} m of the goal` : value.replaceAll("_", " ");
      select.append(make("option", { value }, text));
    }
    select.value = chosen[name] || (name === "group" ? "cause" : "");
    return make("label", { class: select.value && name !== "group" ? "filter on" : "filter", "data-name": name }, LABELS[name], select);
  });
  const isFiltered = NAMES.some((name) => chosen[name] && !["q", "group"].includes(name));
  const more = make("div", { class: isFiltered ? "fields" : "fields closed", id: "fields" }, ...fields.filter((field) => field && field.dataset.name !== "group"));
  const opener = make("button", { class: "chip opener", type: "button", "aria-controls": "fields", "aria-expanded": String(isFiltered),
    onclick: () => { opener.setAttribute("aria-expanded", String(!more.classList.toggle("closed"))); } }, "Filters");
  const clear = make("button", { class: "chip", onclick: () => onChange(null) }, "Clear");
  return make("form", { class: "filters", id: "filters", role: "search", "aria-label": "filters", onsubmit: (event) => event.preventDefault() },
    make("label", { class: search.value ? "filter wide-filter on" : "filter wide-filter" }, "Search", search),
    fields.find((field) => field?.dataset.name === "group"), opener, more, isFiltered || chosen.q ? clear : "");
}

// What the search looks at.
function wordsOf(row) {
  row.words ??= [`#${row.id}`, row.condition, row.goal, row.goal_text, resultText(row), row.end_reason?.replaceAll("_", " "), row.version,
    ...row.tags, ...row.notes].join("\n").toLowerCase();
  return row.words;
}

function matching(rows, chosen) {
  const simple = ["model", "goal", "outcome", "end_reason", "failure", "site"].filter((name) => chosen[name]);
  const nearest = chosen.nearest ? Number(chosen.nearest) : null;
  const words = (chosen.q ?? "").toLowerCase().split(/\s+/).filter(Boolean);
  return rows.filter((row) =>
    simple.every((name) => row[name] === chosen[name])
    && (!chosen.disturbances || row.disturbances === (chosen.disturbances === UNDISTURBED ? "" : chosen.disturbances))
    && (!chosen.start || String(row.start) === chosen.start)
    && (!chosen.tag || row.tags.includes(chosen.tag))
    && words.every((word) => wordsOf(row).includes(word))
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
