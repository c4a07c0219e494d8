// The page: reads the address, shows the list, the grid or an episode, and follows the record while it grows.

const POLL_MS = 1500;
const main = document.getElementById("main");
const message = document.getElementById("message");
let rows = [];
let version = "";
let page = null; // an open episode
let list = null;
let hasAllFailures = true;
let lastResults = "#/";

function route() {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const parts = path.split("/").filter(Boolean);
  const numbers = parts.slice(1).map(Number).filter((number) => Number.isInteger(number) && number > 0);
  if (["episode", "compare"].includes(parts[0]) && numbers.length) return { numbers: numbers.slice(0, 2) };
  const given = new URLSearchParams(query);
  return { chosen: Object.fromEntries(NAMES.map((name) => [name, given.get(name) ?? ""])), view: given.get("view") ?? "list" };
}

function addressOf(chosen) {
  const query = new URLSearchParams(Object.entries(chosen).filter(([, value]) => value));
  return query.size ? `#/?${query}` : "#/";
}

function say(text) {
  message.textContent = text;
  message.hidden = !text;
}

async function show() {
  const { numbers, chosen, view } = route();
  page?.close();
  list?.close();
  page = list = null;
  for (const [name, id] of [["list", "to-list"], ["grid", "to-grid"]]) {
    const link = document.getElementById(id);
    link.toggleAttribute("aria-current", !numbers && view === name);
    link.href = addressOf({ ...(chosen ?? {}), view: name });
  }
  try {
    if (numbers) {
      const opened = new EpisodePage(numbers, rows, annotated);
      page = opened;
      await opened.open();
      if (page === opened) { main.replaceChildren(opened.element); scrollTo(0, 0); }
      document.title = `${numbers.map((number) => `#${number}`).join(" and ")} · vsnbench`;
      return;
    }
    lastResults = location.hash || "#/";
    document.title = "vsnbench results";
    drawResults(chosen, view);
    say("");
  } catch (error) {
    say(error.message);
  }
}

function drawResults(chosen, view) {
  const focused = document.activeElement?.id;
  const scrolled = scrollY;
  const bar = filterBar(rows, chosen, (name, value) => {
    location.hash = addressOf(name === null ? { view } : { ...chosen, [name]: value, view }).slice(1);
  });
  const pairs = chosen.differ ? disagreements(rows, chosen) : null;
  const found = pairs ?? matching(rows, chosen);
  const successes = pairs ? 0 : found.filter((row) => row.counts && row.outcome === "success").length;
  const decided = pairs ? 0 : found.filter((row) => row.counts).length;
  const what = pairs ? `${found.length} trials on which the models disagree`
    : `${found.length} of ${rows.length} episodes${decided ? `; ${successes} of ${decided} counted ones succeeded` : ""}`;
  const count = make("p", { class: "dim", id: "count", role: "status" }, what);
  const marked = list?.marked ?? 0;
  if (view === "grid" && !pairs) {
    main.replaceChildren(bar, count, gridOf(found, addressOf));
  } else {
    list = new EpisodeList(pairs ?? found.toReversed(), pairs
      ? ([a, b]) => `#/compare/${a.id}/${b.id}` : (row) => `#/episode/${row.id}`, !!pairs);
    list.marked = marked;
    main.replaceChildren(bar, count, list.element);
    list.draw();
  }
  if (focused) document.getElementById(focused)?.focus({ preventScroll: true });
  scrollTo(0, scrolled);
}

async function refresh() {
  const listed = await load("data/episodes.json");
  version = listed.version;
  rows = objects(listed);
  await loadFailures();
}

// The kinds of failures follow later: classifying thousands of them takes seconds.
async function loadFailures() {
  const { kinds, is_complete } = await load("data/failures.json");
  for (const row of rows) row.failure = kinds[row.id] ?? "";
  hasAllFailures = is_complete;
}

async function annotated(save) {
  try {
    await save();
    await refresh();
    if (page) page.rows = rows;
    say("");
  } catch (error) {
    say(error.message);
  }
}

async function poll() {
  try {
    const { version: now } = await load("data/version.json");
    if (now !== version) {
      await refresh();
      const { chosen, view } = route();
      if (chosen) { list?.close(); drawResults(chosen, view); } else if (page) page.rows = rows;
    }
    else if (!hasAllFailures) {
      await loadFailures();
      const { chosen, view } = route();
      if (chosen && hasAllFailures) { list?.close(); drawResults(chosen, view); }
    }
    if (message.dataset.lost) { delete message.dataset.lost; say(""); }
  } catch (error) {
    message.dataset.lost = "1";
    say(`The results cannot be read: ${error.message}. Trying again.`);
  }
  setTimeout(poll, POLL_MS);
}

function onKey(event) {
  const inField = event.target.matches("input:not([type=range]), textarea, select");
  if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("help").open) return;
  if (event.key === "Escape") {
    if (inField) event.target.blur();
    else if (page) location.hash = lastResults.slice(1);
    return;
  }
  if (inField) return;
  const inSlider = event.target.matches("input[type=range]");
  const actions = page ? {
    ArrowLeft: () => page.step(-1), ArrowRight: () => page.step(1), Home: () => page.show(0), End: () => page.show(page.last),
    " ": () => page.toggle(), t: () => page.focus("tag"), n: () => page.focus("note"),
    j: () => neighbour(1), k: () => neighbour(-1), ArrowDown: () => neighbour(1), ArrowUp: () => neighbour(-1),
  } : {
    j: () => list?.move(1), k: () => list?.move(-1), ArrowDown: () => list?.move(1), ArrowUp: () => list?.move(-1), Enter: () => list?.open(),
    "/": () => document.querySelector("#filters select")?.focus(),
  };
  actions.g = () => document.getElementById("to-grid").click();
  actions.l = () => document.getElementById("to-list").click();
  actions["?"] = () => document.getElementById("help").showModal();
  const action = actions[event.key];
  if (!action || (event.key === "Enter" && event.target.matches("a, button")) || (event.key === " " && event.target.matches("button"))) return;
  if (inSlider && ["ArrowUp", "ArrowDown"].includes(event.key)) return;
  if (!page && !list && event.key.startsWith("Arrow")) return;
  event.preventDefault();
  action();
}

// Opens the next or previous episode of the filtered list.
function neighbour(by) {
  const query = new URLSearchParams(lastResults.split("?")[1] ?? "");
  const chosen = Object.fromEntries(NAMES.map((name) => [name, query.get(name) ?? ""]));
  const addresses = chosen.differ
    ? disagreements(rows, chosen).map(([a, b]) => `#/compare/${a.id}/${b.id}`)
    : matching(rows, chosen).toReversed().map((row) => `#/episode/${row.id}`);
  const next = addresses[addresses.indexOf(location.hash) + by];
  if (next && addresses.includes(location.hash)) location.hash = next.slice(1);
}

async function begin() {
  try {
    await start();
    await refresh();
  } catch (error) {
    say(error.message);
    return;
  }
  document.getElementById("title").textContent = session.title;
  if (session.report) document.querySelector("header nav").prepend(make("a", { href: session.report }, "Report"));
  addEventListener("hashchange", show);
  addEventListener("keydown", onKey);
  document.getElementById("help-button").addEventListener("click", () => document.getElementById("help").showModal());
  await show();
  if (!isStatic) setTimeout(poll, POLL_MS);
}

begin();
