// The page: reads the address, shows the gallery, the table, the grid, the runs over time, or an episode, and follows the
// record while it grows.

const POLL_MS = 1500;
const VIEWS = ["gallery", "list", "grid", "time"];
const main = document.getElementById("main");
const message = document.getElementById("message");
let rows = [];
let colors = new Map(); // of the models
let version = "";
let page = null; // an open episode
let list = null; // a view of the results that draws itself
let hasAllFailures = true;
let lastResults = "#/";

function route(address = location.hash) {
  const [path, query = ""] = address.replace(/^#\/?/, "").split("?");
  const parts = path.split("/").filter(Boolean);
  const numbers = parts.slice(1).map(Number).filter((number) => Number.isInteger(number) && number > 0);
  if (parts[0] === "report" && isSingle) return { isReport: true };
  if (["episode", "compare"].includes(parts[0]) && numbers.length) return { numbers: numbers.slice(0, MOST_TOGETHER) };
  const given = new URLSearchParams(query);
  const view = given.get("view");
  return { chosen: Object.fromEntries(NAMES.map((name) => [name, given.get(name) ?? ""])), view: VIEWS.includes(view) ? view : "gallery" };
}

function addressOf({ view, ...chosen }) {
  const query = new URLSearchParams(Object.entries({ ...chosen, view: view === "gallery" ? "" : view }).filter(([, value]) => value));
  return query.size ? `#/?${query}` : "#/";
}

function say(text) {
  message.textContent = text;
  message.hidden = !text;
}

function closeView() {
  page?.close();
  list?.close();
  page = list = null;
}

function markView(chosen, view) {
  for (const name of VIEWS) {
    const link = document.getElementById(`to-${name}`);
    link.toggleAttribute("aria-current", view === name);
    link.href = addressOf({ ...(chosen ?? {}), view: name });
  }
}

async function show() {
  const { numbers, chosen, view, isReport } = route();
  closeView();
  markView(chosen, view);
  try {
    if (isReport) {
      main.replaceChildren(reportFrame());
      return;
    }
    if (numbers) {
      const opened = new EpisodePage(numbers, rows, annotated, colors);
      page = opened;
      await opened.open();
      if (page !== opened) return;
      main.replaceChildren(neighbours(), opened.element);
      scrollTo(0, 0);
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

// The report in a single file. Its links to episodes lead to this page, the others into the report.
function reportFrame() {
  const frame = make("iframe", { class: "report", title: "report" });
  frame.srcdoc = embedded("report.html");
  frame.addEventListener("load", () => {
    const inside = frame.contentDocument;
    inside.addEventListener("click", (event) => {
      const target = event.target.closest("a[href^='#']")?.getAttribute("href");
      if (!target) return;
      event.preventDefault();
      if (target.startsWith("#/")) { location.hash = target.slice(1); return; }
      const place = inside.getElementById(target.slice(1));
      for (let at = place; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
      place?.scrollIntoView();
    });
  });
  return frame;
}

function drawResults(chosen, view) {
  const { id: focused, dataset: { place } } = document.activeElement ?? document.body;
  const scrolled = scrollY;
  const change = (name, value) => { location.hash = addressOf(name === null ? { view } : { ...chosen, [name]: value, view }).slice(1); };
  const bar = filterBar(rows, chosen, view, change, (q) => {
    chosen.q = q;
    lastResults = addressOf({ ...chosen, view });
    history.replaceState(null, "", lastResults);
    list?.close();
    markView(chosen, view);
    drawFound(found, chosen, view);
  });
  const found = make("div", { id: "found" });
  main.replaceChildren(bar, found);
  drawFound(found, chosen, view);
  const again = focused ? document.getElementById(focused) : place && found.querySelector(`[data-place="${place}"]`);
  again?.focus?.({ preventScroll: true });
  scrollTo(0, scrolled);
}

// What the results' views and the neighbours of an episode show, in its order: rows, or pairs of rows.
function itemsOf(chosen, view) {
  if (chosen.differ) return disagreements(rows, chosen);
  const found = matching(rows, chosen);
  return view === "gallery" ? groupsOf(found, chosen.group || "cause", colors).flatMap(([, group]) => group) : found.toReversed();
}

const addressOfItem = (item) => (Array.isArray(item) ? `#/compare/${item[0].id}/${item[1].id}` : `#/episode/${item.id}`);

function drawFound(holder, chosen, view) {
  const marked = list?.marked ?? 0;
  const isPairs = !!chosen.differ;
  const found = isPairs ? disagreements(rows, chosen) : matching(rows, chosen);
  const [good, all] = isPairs ? [0, 0] : successesOf(found);
  const what = isPairs ? `${found.length} trials on which the models disagree`
    : `${found.length} of ${counted(rows.length, "episode")}${all ? `; ${good} of ${all} counted ones succeeded` : ""}`;
  const count = make("p", { class: "dim", id: "count", role: "status" }, what);
  list = null;
  if (view === "grid" && !isPairs) {
    holder.replaceChildren(count, gridOf(found, colors, addressOf));
    return;
  }
  const by = chosen.group || "cause";
  list = isPairs ? new EpisodeList(found, addressOfItem, true)
    : view === "gallery" ? new Gallery(groupsOf(found, by, colors), by, colors)
      : view === "time" ? new TimeView(found, colors) : new EpisodeList(found.toReversed(), addressOfItem, false);
  list.marked = marked;
  holder.replaceChildren(count, list.element);
  list.draw();
}

async function refresh() {
  const listed = await load("data/episodes.json");
  version = listed.version;
  rows = objects(listed);
  colors = colorsOf(rows);
  await loadFailures();
}

// The kinds of failures follow later: classifying thousands of them takes seconds.
async function loadFailures() {
  const { kinds, is_complete } = await load("data/failures.json");
  for (const row of rows) {
    row.failure = kinds[row.id] ?? "";
    delete row.words;
  }
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

function redraw() {
  const { chosen, view } = route();
  if (chosen) { list?.close(); drawResults(chosen, view); } else if (page) page.rows = rows;
}

async function poll() {
  try {
    const { version: now } = await load("data/version.json");
    if (now !== version) {
      await refresh();
      redraw();
    } else if (!hasAllFailures) {
      await loadFailures();
      if (hasAllFailures) redraw();
    }
    if (message.dataset.lost) { delete message.dataset.lost; say(""); }
  } catch (error) {
    message.dataset.lost = "1";
    say(`The results cannot be read: ${error.message}. Trying again.`);
  }
  setTimeout(poll, POLL_MS);
}

function onKey(event) {
  const inField = event.target.matches("input:not([type=range], [type=checkbox]), textarea, select");
  if (event.ctrlKey || event.metaKey || event.altKey || document.getElementById("help").open) return;
  if (event.key === "Escape") {
    if (inField) event.target.blur();
    else if (page) location.hash = lastResults.slice(1);
    return;
  }
  if (inField) return;
  const inSlider = event.target.matches("input[type=range]");
  const go = (id) => () => document.getElementById(id)?.click();
  const lines = list instanceof Gallery ? list.columns : 1;
  const actions = page ? {
    ArrowLeft: () => page.step(-1), ArrowRight: () => page.step(1), Home: () => page.show(0), End: () => page.show(page.last),
    " ": () => page.toggle(), t: () => page.focus("tag"), n: () => page.focus("note"),
    j: go("next"), k: go("previous"), ArrowDown: go("next"), ArrowUp: go("previous"),
  } : list?.move ? {
    j: () => list.move(1), k: () => list.move(-1), ArrowDown: () => list.move(lines), ArrowUp: () => list.move(-lines), Enter: () => list.open(),
    ...(list instanceof Gallery ? { ArrowRight: () => list.move(1), ArrowLeft: () => list.move(-1) } : {}),
  } : {};
  if (!page) actions["/"] = () => document.getElementById("search")?.focus();
  Object.assign(actions, { c: go("to-gallery"), l: go("to-list"), g: go("to-grid"), o: go("to-time"), "?": () => document.getElementById("help").showModal() });
  const action = actions[event.key];
  if (!action || (event.key === "Enter" && event.target.matches("a, button, input")) || (event.key === " " && event.target.matches("button, input"))) return;
  if (inSlider && ["ArrowUp", "ArrowDown"].includes(event.key)) return;
  event.preventDefault();
  action();
}

// Links to the results, and to the episodes before and after the open one in their order.
function neighbours() {
  const { chosen, view } = route(lastResults);
  const addresses = itemsOf(chosen, view).map(addressOfItem);
  const place = addresses.indexOf(location.hash);
  const to = (at, id, text) => {
    const address = place < 0 ? undefined : addresses[at];
    return address ? make("a", { class: "chip", id, href: address }, text) : make("span", { class: "chip off", "aria-hidden": "true" }, text);
  };
  return make("nav", { class: "links", "aria-label": "results" }, make("a", { class: "chip", href: lastResults }, "← results"),
    to(place - 1, "previous", "‹ previous"), to(place + 1, "next", "next ›"),
    place < 0 ? "" : make("span", { class: "dim small" }, `${place + 1} of ${addresses.length}`));
}

async function begin() {
  try {
    await start();
    await refresh();
  } catch (error) {
    say(error.message);
    return;
  }
  const left = [every > 1 ? `pictures of every ${every}. action` : "", hasFurther ? "" : "pictures of the main camera only"].filter(Boolean);
  document.getElementById("title").textContent = left.length ? `${session.title}: ${left.join(", ")}` : session.title;
  if (session.report) document.querySelector("header nav").prepend(make("a", { href: session.report }, "Report"));
  addEventListener("hashchange", show);
  addEventListener("keydown", onKey);
  document.getElementById("help-button").addEventListener("click", () => document.getElementById("help").showModal());
  await show();
  if (!isStatic) setTimeout(poll, POLL_MS);
}

begin();
